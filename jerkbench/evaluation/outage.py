"""Position errors while there is no aiding."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import known, position_error_m, rms_norm
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("metric", "outage")
@dataclass(frozen=True)
class Outage:
    """Position error inside the recording's outages, and at their ends.

    With e_i = p_i - p_ref,i [m], ENU; the rows inside outage j are the counted ones with begin_j <= t_i < end_j whose
    reference is known (at the end itself a fix may already have come), and l(j) is the last of them::

        outage_rmse_m     = sqrt(1/N sum |e_i|^2)       over the N rows inside any outage
        outage_end_m      = mean over j of |e_l(j)|
        outage_end_max_m  = max over j of |e_l(j)|

    An outage without such a row is left out; NaN if that leaves none.
    """

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values by column name."""
        counted = counted & known(recording.reference.enu_m, estimate)
        error = position_error_m(estimate, recording)[counted]
        inside = _inside(recording.reference.t_s[estimate.index][counted], recording.outages_s)
        ends = np.array([rms_norm(error[rows][-1:]) for rows in inside if rows.any()])
        return {
            "outage_rmse_m": rms_norm(error[inside.any(axis=0)]),
            "outage_end_m": float(ends.mean()) if ends.size else float("nan"),
            "outage_end_max_m": float(ends.max()) if ends.size else float("nan"),
        }


def _inside(t_s: FloatArray, outages_s: FloatArray) -> BoolArray:
    """Return (j, k) whether time k lies in outage j."""
    begin, end = outages_s[:, :1], outages_s[:, 1:]
    rows: BoolArray = (t_s >= begin) & (t_s < end)
    return rows
