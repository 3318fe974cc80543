"""Recording -> Attitude: tilt, yaw, gravity compensation."""
