"""Inspection of a recording: lags between streams, measured and stated noise, IMU grade, and mistakes."""
