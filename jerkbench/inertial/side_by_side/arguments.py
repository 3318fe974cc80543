"""Arguments of the runs side by side besides those of the kernel; WIDTH is their number."""

from typing import NamedTuple

from jerkbench.arrays import FloatCube, FloatMatrix, FloatVector, IntVector


class Inertial(NamedTuple):
    """What the runs sense, and their begin.

    Attributes:
        dt_s: (lengths,) of the steps.
        accel_mps2: (samples, 3, WIDTH).
        gyro_radps: (samples, 3, WIDTH).
        noise: (4, WIDTH) power densities: angle, velocity, gyro bias, accelerometer bias.
        x0: (6, WIDTH) position and velocity at the start.
        P0: (225, WIDTH) covariance of the error there.
        heading: (n,) row of ``yaw`` after each step, or -1.
        yaw: (h, 2, WIDTH) measured yaw [rad], NaN where there is none, and its sigma.
        dcm: (k, 9, WIDTH) room for the attitude at the visited stamps of the reference; or no row.
    """

    dt_s: FloatVector
    accel_mps2: FloatCube
    gyro_radps: FloatCube
    noise: FloatMatrix
    x0: FloatMatrix
    P0: FloatMatrix
    heading: IntVector
    yaw: FloatCube
    dcm: FloatCube
