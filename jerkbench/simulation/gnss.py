"""Position, velocity and heading measurements of a true motion, with noise."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.geometry import dcm_from_euler, wrap_angle
from jerkbench.random_streams import stream
from jerkbench.recording import Heading, Position, Velocity


def measure_position(t_s: FloatArray, enu_m: FloatArray, sigma_m: tuple[float, ...], noise: FloatArray) -> Position:
    """Return fixes; ``noise`` (m, 3) has unit variance, or is zero."""
    return Position(t_s, enu_m + noise * np.asarray(sigma_m), _covariances(sigma_m, len(t_s)))


def antenna_m(enu_m: FloatArray, euler_rad: FloatArray, arm_m: tuple[float, ...]) -> FloatArray:
    """Return where an antenna is (m, 3): p + Omega l, with the arm l forward, left, up of the body."""
    return np.asarray(enu_m + dcm_from_euler(euler_rad) @ np.asarray(arm_m)) if any(arm_m) else enu_m


def measure_velocity(t_s: FloatArray, mps: FloatArray, sigma_mps: tuple[float, ...], noise: FloatArray) -> Velocity:
    """Return velocities in ENU; ``noise`` (m, 3) has unit variance, or is zero."""
    return Velocity(t_s, mps + noise * np.asarray(sigma_mps), _covariances(sigma_mps, len(t_s)))


def measure_heading(t_s: FloatArray, yaw_rad: FloatArray, sigma_rad: float, noise: FloatArray) -> Heading:
    """Return headings, wrapped to (-pi, pi]; ``noise`` (m,) has unit variance, or is zero."""
    return Heading(t_s, wrap_angle(yaw_rad + sigma_rad * noise), np.full(len(t_s), sigma_rad))


def white(seed: int, sensor: str, shape: tuple[int, ...], on: bool) -> FloatArray:
    """Return noise of unit variance from the sensor's own stream; zeros when it is not ``on``."""
    return stream(seed, "dataset", sensor).standard_normal(shape) if on else np.zeros(shape)


def _covariances(sigma: tuple[float, ...], rows: int) -> FloatArray:
    return np.tile(np.diag(np.square(sigma)), (rows, 1, 1))
