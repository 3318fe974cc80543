"""Attitude errors."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import euler_error_rad, known, rms_norm
from jerkbench.plugins import register
from jerkbench.recording import Recording

STEEPEST_RAD = np.radians(75.0)
"""Up to this pitch of the reference, roll and yaw are angles of their own."""


@register("metric", "attitude_rmse")
@dataclass(frozen=True)
class AttitudeRmse:
    """Root mean square error of roll, pitch and yaw.

    With e_i the difference of the angles wrapped to (-pi, pi] [rad], over the N counted rows whose reference knows
    that angle::

        roll_rmse_rad = sqrt(1/N sum e_roll,i^2)        pitch_rmse_rad, yaw_rmse_rad likewise

    Rows whose reference is pitched by more than 75 degrees do not count for roll and yaw, which are one angle at 90
    degrees; `inclination` has no such hole.

    NaN without a single such row.
    """

    reads: ClassVar[str] = "attitude"

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values by column name."""
        error = euler_error_rad(estimate, recording)
        truth = recording.reference.euler_rad
        steep = np.zeros(len(error), dtype=bool) if truth is None else np.abs(truth[estimate.index, 1]) > STEEPEST_RAD
        values = {}
        for axis, name in enumerate(("roll", "pitch", "yaw")):
            rows = counted & known(truth, estimate, (axis,)) & (~steep | (name == "pitch"))
            values[f"{name}_rmse_rad"] = rms_norm(error[rows][:, [axis]])
        return values
