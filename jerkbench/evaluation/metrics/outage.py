"""Position errors while there is no aiding."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_rows import counting
from jerkbench.evaluation.navigation_errors import mean, position_error_m, rms, rms_norm
from jerkbench.evaluation.sums import Summed
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.sums import Sums


@register("metric", "outage")
@dataclass(frozen=True)
class Outage(Summed):
    """Position error inside the recording's outages, and at their ends.

    With e_i = p_i - p_ref,i [m], ENU, over rows whose reference is known, and row i inside outage j if
    begin_j <= t_i < end_j (at the end itself a fix may already have come)::

        outage_rmse_m     = sqrt(1/N sum |e_i|^2)       over the N counted rows inside any outage
        l(j)              = the last row inside outage j, scored or not, from the first counted row on
        J                 = the outages with end_j - t_l(j) <= 2 dt,    dt = median interval of the known reference
        outage_end_m      = mean over j in J of |e_l(j)|
        outage_end_max_m  = max over j in J of |e_l(j)|
        outage_end_percent = 100 sum over J of |e_l(j)| / sum over J of d_j
        outages_counted   = how many outages J has

    with d_j the way of the reference from the first row inside outage j to the last. An outage whose end the reference
    or the run does not reach is thus left out, and seen to be. Errors are NaN without such a row or outage, the part of
    the distance also where all stood still; all five without any outage.
    """

    reads_nees: ClassVar[bool] = False

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the five values by column name."""
        ends, driven_m = sums.outage_ends_m, float(sums.outage_driven_m.sum())
        return {
            "outage_rmse_m": rms(sums.outage_m2, sums.outage_rows),
            "outage_end_m": mean(float(ends.sum()), float(ends.size)),
            "outage_end_max_m": float(ends.max()) if ends.size else float("nan"),
            "outage_end_percent": mean(100 * float(ends.sum()), driven_m),
            "outages_counted": float(ends.size) if sums.outages else float("nan"),
        }


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


@register("metric", "outage_drift")
@dataclass(frozen=True)
class OutageDrift(Summed):
    """Growth of the position error over an outage, per second.

    With f(j) and l(j) the first and the last row inside outage j, as in the metric `outage`, and e_i the error [m]::

        outage_drift_mps = mean over j of |e_l(j) - e_f(j)|/(t_l(j) - t_f(j))

    The error with which the outage began does not count. NaN without an outage of two rows.
    """

    reads_nees: ClassVar[bool] = False

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the value by column name."""
        drifts = sums.outage_drifts_mps[~np.isnan(sums.outage_drifts_mps)]
        return {"outage_drift_mps": mean(float(drifts.sum()), float(drifts.size))}
