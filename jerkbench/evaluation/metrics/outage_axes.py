"""Position errors while there is no aiding, horizontal and vertical apart."""

from dataclasses import dataclass
from typing import ClassVar

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_stamps import counting
from jerkbench.evaluation.navigation_errors import position_error_m, rms_norm
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("metric", "outage_axes")
@dataclass(frozen=True)
class OutageAxes:
    """Position error inside the recording's outages, horizontal and vertical apart.

    With e_i = p_i - p_ref,i [m], ENU, over the N counted rows inside any outage, as in `outage`::

        outage_rmse_horizontal_m  = sqrt(1/N sum (e_east^2 + e_north^2))
        outage_rmse_up_m          = sqrt(1/N sum e_up^2)

    A wheel's speed holds the one and leaves the other to the attitude. NaN without such a row.
    """

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the two values by column name."""
        inside = counting(estimate.index, recording, counted).outage
        error = position_error_m(estimate, recording)[inside]
        return {"outage_rmse_horizontal_m": rms_norm(error[:, :2]), "outage_rmse_up_m": rms_norm(error[:, 2:])}
