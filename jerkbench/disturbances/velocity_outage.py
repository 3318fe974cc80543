"""Intervals without velocity."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.disturbances.common import OutageWindows, without
from jerkbench.errors import RecordingError
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("disturbance", "velocity_outage")
@dataclass(frozen=True)
class VelocityOutage(OutageWindows):
    """No velocity in the given windows; position, heading and reference stay.

    Its windows count as outages too: the metrics tell how well position alone holds the filter in them.
    """

    seeded: ClassVar[bool] = False

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording without velocity in the windows.

        Raises:
            RecordingError: it has no velocity.
        """
        if recording.velocity is None:
            raise RecordingError(
                f"{recording.name} has no velocity, so none can be missing; leave velocity_outage out."
            )
        windows = self.windows_in(recording)
        outages_s = np.concatenate([recording.outages_s, windows])
        return replace(recording, velocity=without(recording.velocity, windows), outages_s=outages_s)
