"""Intervals without GNSS."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.disturbances.common import OutageWindows, without
from jerkbench.plugins import register
from jerkbench.recording import Heading, Recording


@register("disturbance", "gnss_outage")
@dataclass(frozen=True)
class GnssOutage(OutageWindows):
    """No position and no velocity in the given windows; the reference stays, and so does a wheel's speed.

    A heading that is a receiver's course goes with it, one of odometry stays.

    Attributes:
        heading: whether the dual-antenna heading goes too (it comes from the same antennas, but the paper's outage
            concerns position and velocity).
    """

    seeded: ClassVar[bool] = False

    heading: bool = False

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording without GNSS in the windows."""
        windows, velocity, heading = self.windows_in(recording), recording.velocity, recording.heading
        is_wheel = velocity is not None and velocity.frame == "speed"
        return replace(
            recording,
            position=without(recording.position, windows),
            velocity=velocity if is_wheel else without(velocity, windows),
            heading=without(heading, windows) if self._takes(heading) else heading,
            outages_s=np.concatenate([recording.outages_s, windows]),
        )

    def _takes(self, heading: Heading | None) -> bool:
        if heading is None or heading.source == "odometry":
            return False
        return heading.source == "course" or self.heading
