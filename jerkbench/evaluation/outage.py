"""Position errors while there is no aiding."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import known, position_error_m, rms_norm
from jerkbench.plugins import register
from jerkbench.recording import Recording, Reference

OLDEST = 2 + 1e-6
"""Intervals of the reference that the last error may be older than the end; more than two by the rounding of stamps."""


@register("metric", "outage")
@dataclass(frozen=True)
class Outage:
    """Position error inside the recording's outages, and at their ends.

    With e_i = p_i - p_ref,i [m], ENU, over rows whose reference is known, and row i inside outage j if
    begin_j <= t_i < end_j (at the end itself a fix may already have come)::

        outage_rmse_m     = sqrt(1/N sum |e_i|^2)       over the N counted rows inside any outage
        l(j)              = the last row inside outage j, scored or not, from the first counted row on
        J                 = the outages with end_j - t_l(j) <= 2 dt,    dt = median interval of the known reference
        outage_end_m      = mean over j in J of |e_l(j)|
        outage_end_max_m  = max over j in J of |e_l(j)|
        outages_counted   = how many outages J has

    An outage whose end the reference or the run does not reach is thus left out, and seen to be. Errors are NaN without
    such a row or outage, all four without any outage.
    """

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the four values by column name."""
        there = known(recording.reference.enu_m, estimate)
        error = position_error_m(estimate, recording)
        t_s = recording.reference.t_s[estimate.index]
        inside = inside_outages(t_s, recording.outages_s) & there
        late = t_s >= np.min(t_s[counted], initial=np.inf)
        found = outage_rows(inside & late, t_s, recording)
        ends = np.array([rms_norm(error[[last]]) for _, last in found])
        return {
            "outage_rmse_m": rms_norm(error[inside.any(axis=0) & counted]),
            "outage_end_m": float(ends.mean()) if ends.size else float("nan"),
            "outage_end_max_m": float(ends.max()) if ends.size else float("nan"),
            "outages_counted": float(ends.size) if len(recording.outages_s) else float("nan"),
        }


def inside_outages(t_s: FloatArray, outages_s: FloatArray) -> BoolArray:
    """Return (j, k) whether time k lies in outage j."""
    begin, end = outages_s[:, :1], outages_s[:, 1:]
    rows: BoolArray = (t_s >= begin) & (t_s < end)
    return rows


def outage_rows(inside: BoolArray, t_s: FloatArray, recording: Recording) -> list[tuple[int, int]]:
    """Return the first and the last row inside each outage, (j, k) rows, where the last is near the outage's end."""
    oldest_s = OLDEST * _interval_s(recording.reference)
    ends = (
        (int(np.argmax(rows)), int(np.flatnonzero(rows)[-1]), end)
        for rows, (_, end) in zip(inside, recording.outages_s, strict=True)
        if rows.any()
    )
    return [(first, last) for first, last, end in ends if end - t_s[last] <= oldest_s]


def _interval_s(reference: Reference) -> float:
    """Return the median interval [s] between the stamps at which the position is known; 0 of fewer than two."""
    if reference.enu_m is None:
        return 0.0
    known_s = reference.t_s[np.isfinite(reference.enu_m).all(axis=1)]
    return float(np.median(np.diff(known_s))) if len(known_s) > 1 else 0.0
