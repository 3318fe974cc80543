"""Position errors."""

from dataclasses import dataclass

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_stamps import POSITION_AXES
from jerkbench.evaluation.navigation_errors import rms
from jerkbench.evaluation.sums import sums_of
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.sums import Sums


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
        return self.summarise(sums_of(estimate, recording, counted))

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the same from the sums of a run."""
        each = zip(POSITION_AXES, sums.position_m2, sums.position_rows, strict=True)
        values = {f"position_rmse{name}_m": rms(square, rows) for name, square, rows in each}
        values["position_rmse_whole_m"] = rms(sums.whole_m2, sums.whole_rows)
        values["position_max_m"] = sums.position_max_m
        return values
