"""Intervals without GNSS."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.disturbances._outages import OutageWindows, without
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("disturbance", "gnss_outage")
@dataclass(frozen=True)
class GnssOutage(OutageWindows):
    """No position and no velocity in the given windows; the reference stays.

    Attributes:
        heading: whether the dual-antenna heading goes too (it comes from the same antennas, but the paper's outage
            concerns position and velocity).
    """

    seeded: ClassVar[bool] = False

    heading: bool = False

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording without GNSS in the windows."""
        windows = self.windows_in(recording)
        return replace(
            recording,
            position=without(recording.position, windows),
            velocity=without(recording.velocity, windows),
            heading=without(recording.heading, windows) if self.heading else recording.heading,
            outages_s=np.concatenate([recording.outages_s, windows]),
        )
