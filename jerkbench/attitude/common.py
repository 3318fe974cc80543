"""What every attitude plugin ends with: yaw, Omega, gravity compensation."""

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.attitude.track import Track
from jerkbench.attitude.yaw import Yaw, estimate_yaw, yaw_rate
from jerkbench.estimate import Attitude
from jerkbench.geometry import dcm_from_euler
from jerkbench.recording import GRAVITY_MPS2, Heading, Imu

# Gravity compensation: specific force of the body -> acceleration in ENU.

COMPENSATIONS = ("midpoint", "endpoint")


def compensate_gravity(dcm: FloatArray, accel_mps2: FloatArray, compensation: str) -> FloatArray:
    """Return u (n, 3), the acceleration in ENU [m/s2].

    u_k = mean(Omega_{k-1}, Omega_k) y_A + (0, 0, -g) with ``midpoint`` (a sample is the mean over the interval
    between the two; the first one has Omega_0 alone), Omega_k y_A + (0, 0, -g) with ``endpoint``.

    Args:
        dcm: (n, 3, 3) Omega, body -> ENU, at the end of each sample.
        accel_mps2: (n, 3) y_A, specific force, body.
        compensation: one of `COMPENSATIONS`.
    """
    turn = dcm
    if compensation == "midpoint":
        turn = dcm.copy()
        turn[1:] = 0.5 * (dcm[:-1] + dcm[1:])
    rotated: FloatArray = np.einsum("kij,kj->ki", turn, accel_mps2)
    return np.asarray(rotated - np.array([0.0, 0.0, GRAVITY_MPS2]))


def intervals(imu: Imu) -> FloatArray:
    """The interval (n,) that ends at each stamp; nobody saw the first one begin, so it is the nominal one."""
    return np.concatenate(([imu.nominal_interval_s], np.diff(imu.t_s)))


def filtered_yaw(
    imu: Imu,
    roll_rad: FloatArray,
    pitch_rad: FloatArray,
    source: Heading | Track | None,
    walk_rad_per_sqrt_s: float,
    course_sigma_min_rad: float,
) -> Yaw:
    """Return the yaw that the yaw filter finds with the gyro and ``source``."""
    rate = yaw_rate(imu.gyro_radps, roll_rad, pitch_rad)
    return estimate_yaw(imu.t_s, intervals(imu), rate, source, walk_rad_per_sqrt_s, course_sigma_min_rad)


def attitude_from(
    imu: Imu,
    euler_rad: FloatArray,
    compensation: str,
    triggered: BoolArray | None = None,
    yaw_sigma_rad: FloatArray | None = None,
) -> Attitude:
    """Return the attitude (n, 3) with Omega and the ENU acceleration; ``triggered`` None: never."""
    dcm = dcm_from_euler(euler_rad)
    accel = compensate_gravity(dcm, imu.accel_mps2, compensation)
    never = np.zeros(len(imu.t_s), dtype=np.bool_)
    return Attitude(imu.t_s, dcm, euler_rad, accel, never if triggered is None else triggered, yaw_sigma_rad)
