"""Measurements that are older than their stamps say."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.disturbances.common import Once, Stream, rows_of
from jerkbench.errors import PluginError
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("disturbance", "latency")
@dataclass(frozen=True)
class Latency(Once):
    """Stamps that are later than the time at which the values were true; nobody is told.

    t' = t + d. A measurement whose stamp comes after the end of the recording is left out. The error that it makes is
    the motion within d (at 1.5 m/s and .1 s 15 cm): no covariance knows of it, the true one neither.

    Attributes:
        position_s: d of the fixes.
        velocity_s: d of the velocity.
        heading_s: d of the heading.
    """

    seeded: ClassVar[bool] = False

    position_s: float = 0.1
    velocity_s: float = 0.0
    heading_s: float = 0.0

    def __post_init__(self) -> None:
        """Check that no latency is negative."""
        for name in ("position_s", "velocity_s", "heading_s"):
            if not 0 <= getattr(self, name) < np.inf:
                raise PluginError(f"{name} is {getattr(self, name)}; a latency must be 0 s or more.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with later stamps."""
        end_s = recording.duration_s
        return replace(
            recording,
            position=_later(recording.position, self.position_s, end_s),
            velocity=_later(recording.velocity, self.velocity_s, end_s),
            heading=_later(recording.heading, self.heading_s, end_s),
        )


def _later(measured: Stream | None, late_s: float, end_s: float) -> Stream | None:
    if measured is None or not late_s:
        return measured
    kept = rows_of(measured, measured.t_s + late_s <= end_s)
    return replace(kept, t_s=kept.t_s + late_s)
