"""Attitude estimation: tilt, yaw and gravity-compensated acceleration from a recording."""
