"""Wheels that turn faster than the vehicle drives."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray, nearest_rows
from jerkbench.disturbances.common import RegularWindows, WindowTimes, displaced, in_any, require_values
from jerkbench.errors import RecordingError
from jerkbench.plugins import register
from jerkbench.recording import Recording, Reference, Velocity


@register("disturbance", "wheel_slip")
@dataclass(frozen=True)
class WheelSlip(RegularWindows):
    """Velocity that is too large along the heading in the given windows; the reported covariance does not change.

    With the horizontal unit vector h of the heading, and the slip s::

        v' = v + o,  o = s (h'v) h;  R_true' = R_true + o o'

    A velocity in the body frame, and a wheel's speed, has h = (1, 0, 0). One in ENU takes the yaw of the reference at
    the stamp nearest to it; where the reference knows none, h is the velocity's own course, forwards. A row of a
    body's velocity or of one in ENU without both horizontal axes stays as it is.

    Attributes:
        slip: s; 0.3 is 30 % too fast, -1 is wheels that lock.
    """

    fault: ClassVar[str] = "wheel slip"

    windows_s: WindowTimes = ((20.0, 24.0), (60.0, 66.0), (115.0, 120.0))
    slip: float = 0.3

    def __post_init__(self) -> None:
        """Check windows and slip."""
        super().__post_init__()
        require_values(self, ("slip",), np.isfinite, "give a finite number, 0.3 for 30 % too fast.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with slip in the windows.

        Raises:
            RecordingError: it has no velocity, or none with east and north in one row.
        """
        velocity = recording.velocity
        if velocity is None:
            raise RecordingError(f"{recording.name} has no velocity, so no wheel can slip; leave wheel_slip out.")
        together = velocity.mps[:, :1] if velocity.frame == "speed" else velocity.mps[:, :2]
        if len(velocity.t_s) and not np.isfinite(together).all(axis=1).any():
            raise RecordingError(
                f"{recording.name} has no velocity with east and north at one time, so nothing along a heading can"
                " slip; leave wheel_slip out, or give both the same latency."
            )
        offset = self.slip * _along(velocity, recording.reference)
        offset[~in_any(velocity.t_s, self.windows)] = 0.0
        return replace(recording, velocity=displaced(velocity, offset))


def _along(velocity: Velocity, reference: Reference) -> FloatArray:
    """Return (h'v) h (m, 3), zero where it is not known."""
    v = velocity.mps * [1.0, 1.0, 0.0]
    if velocity.frame in ("body", "speed"):
        return np.asarray(np.nan_to_num(v * [1.0, 0.0, 0.0]))
    yaw = _reference_yaw(velocity.t_s, reference)
    h = np.column_stack([np.cos(yaw), np.sin(yaw), 0.0 * yaw])
    level = v[:, :2]
    along = np.einsum("mi,mi->m", h[:, :2], level)[:, None] * h
    own_course = np.column_stack([level, np.zeros(len(v))])  # with h = v/|v| it is v itself
    offset = np.where(np.isfinite(h[:, :1]), along, own_course)
    complete = np.isfinite(level).all(axis=1, keepdims=True)
    return np.where(complete, offset, 0.0)


def _reference_yaw(t_s: FloatArray, reference: Reference) -> FloatArray:
    """Return the yaw (m,) of the reference at the stamps nearest to ``t_s``, NaN where it knows none."""
    if reference.euler_rad is None or not len(reference.t_s):
        return np.full(len(t_s), np.nan)
    return np.asarray(reference.euler_rad[nearest_rows(reference.t_s, t_s), 2])
