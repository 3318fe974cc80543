"""Intervals without position."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.disturbances.common import OutageWindows, without
from jerkbench.errors import RecordingError
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("disturbance", "position_outage")
@dataclass(frozen=True)
class PositionOutage(OutageWindows):
    """No position in the given windows; velocity, heading and reference stay.

    It shows what velocity aiding is worth: the position error grows with the integral of the velocity's error, not
    with the double integral of the accelerometer's.
    """

    seeded: ClassVar[bool] = False

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording without position in the windows.

        Raises:
            RecordingError: it has no position.
        """
        if recording.position is None:
            raise RecordingError(
                f"{recording.name} has no position fixes, so none can be missing; leave position_outage out."
            )
        windows = self.windows_in(recording)
        outages_s = np.concatenate([recording.outages_s, windows])
        return replace(recording, position=without(recording.position, windows), outages_s=outages_s)
