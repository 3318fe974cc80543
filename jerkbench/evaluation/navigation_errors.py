"""Errors of an estimate at the reference's stamps, and their root mean square: one definition for every metric."""

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.estimate import Estimate
from jerkbench.geometry import vertical_in_body, wrap_angle
from jerkbench.recording import Recording


def position_error_m(estimate: Estimate, recording: Recording) -> FloatArray:
    """Return (k, 3) estimate less reference, ENU [m]; NaN where the reference is not known."""
    return _error(estimate.position_m, recording.reference.enu_m, estimate)


def position_error_length_m(estimate: Estimate, recording: Recording) -> FloatArray:
    """Return (k,) the length of the position error [m]; NaN where it is not known or not finite."""
    with np.errstate(over="ignore", invalid="ignore"):
        length: FloatArray = np.sqrt(np.sum(position_error_m(estimate, recording) ** 2, axis=1))
    return np.where(np.isfinite(length), length, np.nan)


def velocity_error_mps(estimate: Estimate, recording: Recording) -> FloatArray:
    """Return (k, 3) estimate less reference, ENU [m/s]; NaN where the reference is not known."""
    return _error(estimate.velocity_mps, recording.reference.velocity_mps, estimate)


def euler_error_rad(estimate: Estimate, recording: Recording) -> FloatArray:
    """Return (k, 3) roll, pitch, yaw less reference, each wrapped to (-pi, pi]; NaN where it is not known."""
    return wrap_angle(_error(estimate.euler_rad, recording.reference.euler_rad, estimate))


def inclination_error_rad(estimate: Estimate, recording: Recording) -> FloatArray:
    """Return (k,) the angle between estimated and true vertical, seen from the body; NaN where it is not known."""
    truth = recording.reference.euler_rad
    if truth is None:
        return np.full(len(estimate.index), np.nan)
    return angle_between(vertical_in_body(estimate.euler_rad), vertical_in_body(truth[estimate.index]))


def angle_between(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the angle (k,) [rad] between the rows of two (k, 3)."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), np.sum(a * b, axis=1)))


def known(truth: FloatArray | None, estimate: Estimate, axes: tuple[int, ...] = (0, 1, 2)) -> BoolArray:
    """Return (k,) whether all ``axes`` of the reference are numbers at the estimate's rows."""
    if truth is None:
        return np.zeros(len(estimate.index), dtype=bool)
    return np.asarray(np.isfinite(truth[estimate.index][:, axes]).all(axis=1))


def rms_norm(vectors: FloatArray) -> float:
    """Return sqrt(mean |v|^2) over the rows of (k, m); NaN without rows, infinite where it overflows.

    A NaN is not left out: an estimate that is not a number must not improve its own score.
    """
    if len(vectors) == 0:
        return float("nan")
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))


def largest_norm(vectors: FloatArray) -> float:
    """Return max |v| over the rows of (k, m); NaN without rows."""
    if len(vectors) == 0:
        return float("nan")
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.max(np.sqrt(np.sum(vectors**2, axis=1))))


def rms(square: float, rows: float) -> float:
    """Return sqrt(square/rows) of a sum of squares over so many rows; NaN without rows."""
    return float(np.sqrt(mean(square, rows)))


def mean(total: float, rows: float) -> float:
    """Return total/rows; NaN without rows."""
    return float(total / rows) if rows else float("nan")


def _error(value: FloatArray, truth: FloatArray | None, estimate: Estimate) -> FloatArray:
    if truth is None:
        return np.full_like(value, np.nan)
    return value - truth[estimate.index]
