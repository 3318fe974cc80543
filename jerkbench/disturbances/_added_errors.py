"""Errors added to positions or velocities, with what the true covariance then is."""

from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.recording import Position, Velocity

Measured = TypeVar("Measured", Position, Velocity)


def values_of(measured: Position | Velocity) -> FloatArray:
    """Return what was measured (m, 3)."""
    return measured.enu_m if isinstance(measured, Position) else measured.mps


def reported_covariance(measured: Position | Velocity) -> FloatArray:
    """Return the covariance as reported (m, 3, 3)."""
    return measured.covariance_m2 if isinstance(measured, Position) else measured.covariance_m2ps2


def true_covariance(measured: Position | Velocity) -> FloatArray:
    """Return the true covariance (m, 3, 3) where it is known, else the reported one."""
    true = measured.true_covariance_m2 if isinstance(measured, Position) else measured.true_covariance_m2ps2
    return reported_covariance(measured) if true is None else true


def with_errors(
    measured: Measured, errors: FloatArray, growth: FloatArray, *, reported_growth: FloatArray | float = 0.0
) -> Measured:
    """Return the measurements with errors added.

    Args:
        measured: m rows.
        errors: (m, 3) what is added to the values.
        growth: (m, 3, 3) what is added to the true covariance.
        reported_growth: (m, 3, 3) what is added to the reported one; 0: it does not know.
    """
    true = true_covariance(measured) + growth
    reported = reported_covariance(measured) + reported_growth
    values = values_of(measured) + errors
    names = ("enu_m", "covariance_m2", "true_covariance_m2")
    if isinstance(measured, Velocity):
        names = ("mps", "covariance_m2ps2", "true_covariance_m2ps2")
    changes: dict[str, Any] = dict(zip(names, (values, reported, true), strict=True))
    return replace(measured, **changes)


def squares(errors: FloatArray) -> FloatArray:
    """Return o o' (m, 3, 3) of offsets o (m, 3)."""
    return np.asarray(errors[:, :, None] * errors[:, None, :])
