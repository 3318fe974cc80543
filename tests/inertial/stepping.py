"""One step from what the sensors show."""

from jerkbench.inertial.mechanisation import advance, calibrated


def mechanise(state, accel_mps2, gyro_radps, dt_s, earth):
    return advance(state, *calibrated(state, accel_mps2, gyro_radps), dt_s, earth)
