"""What a recording tells about itself: lags between its streams, real against stated noise, the grade of its IMU."""
