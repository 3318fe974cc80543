"""Attitude errors."""

from dataclasses import dataclass

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import euler_error_rad, known, rms_norm
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("metric", "attitude_rmse")
@dataclass(frozen=True)
class AttitudeRmse:
    """Root mean square error of roll, pitch and yaw.

    With e_i the difference of the angles wrapped to (-pi, pi] [rad], over the N counted rows whose reference knows
    that angle::

        roll_rmse_rad = sqrt(1/N sum e_roll,i^2)        pitch_rmse_rad, yaw_rmse_rad likewise

    NaN without a single such row.
    """

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values by column name."""
        error = euler_error_rad(estimate, recording)
        truth = recording.reference.euler_rad
        return {
            f"{name}_rmse_rad": rms_norm(error[counted & known(truth, estimate, (axis,))][:, [axis]])
            for axis, name in enumerate(("roll", "pitch", "yaw"))
        }
