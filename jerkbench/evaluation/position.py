"""Position errors."""

from dataclasses import dataclass

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import known, largest_norm, position_error_m, rms_norm
from jerkbench.plugins import register
from jerkbench.recording import Recording

AXES = {"": (0, 1, 2), "_horizontal": (0, 1), "_east": (0,), "_north": (1,), "_up": (2,)}
"""What the column's name says, and the axes that it takes."""


@register("metric", "position_rmse")
@dataclass(frozen=True)
class PositionRmse:
    """Root mean square and largest position error, without any alignment.

    With e_i = p_i - p_ref,i [m], ENU, over the N counted rows whose reference is known on the axes in question::

        position_rmse_m             = sqrt(1/N sum |e_i|^2)                  east, north and up
        position_rmse_horizontal_m  = sqrt(1/N sum (e_east^2 + e_north^2))
        position_rmse_east_m, _north_m, _up_m                                each axis alone
        position_rmse_whole_m       = the first, over all scored rows: the burn-in counts too
        position_max_m              = max |e_i|

    NaN without a single such row.
    """

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the seven values by column name."""
        error = position_error_m(estimate, recording)
        truth = recording.reference.enu_m
        values = {
            f"position_rmse{name}_m": rms_norm(error[counted & known(truth, estimate, axes)][:, axes])
            for name, axes in AXES.items()
        }
        scored = recording.reference.scored[estimate.index]
        there = known(truth, estimate)
        values["position_rmse_whole_m"] = rms_norm(error[scored & there])
        values["position_max_m"] = largest_norm(error[counted & there])
        return values
