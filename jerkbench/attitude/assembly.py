"""The attitude from roll and pitch, for every attitude plugin: yaw, Omega, gravity compensation."""

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.attitude.compensation import compensate_gravity
from jerkbench.attitude.track import Track
from jerkbench.attitude.yaw import Yaw, estimate_yaw, yaw_rate
from jerkbench.estimate import Attitude
from jerkbench.geometry import dcm_from_euler
from jerkbench.recording import Heading, Imu


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
