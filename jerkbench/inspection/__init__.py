"""The inspection of a recording: lags between streams, real against stated noise, the grade of its IMU."""
