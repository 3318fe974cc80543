"""Lockout: the number and the length of the runs of fixes that an adaptation does not believe."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.estimate import Estimate, Updates
from jerkbench.evaluation.counted_rows import first_counted_s
from jerkbench.measurements import VARIANCE_FLOOR
from jerkbench.plugins import register
from jerkbench.recording import Recording

INFLATED = 4.0
"""A variance that is so many times the reported one: twice the sigma."""


@register("metric", "lockout")
@dataclass(frozen=True)
class Lockout:
    """Updates of which a position was inflated or rejected, and the longest streak of them.

    With R_ua the variance used for position axis a in update u and r_ua the one that the fix reported, over the updates
    with a position, from the first counted row on::

        inflated  any a: R_ua > 4 r_ua        rejected  all a: R_ua infinite (such an update is inflated too)

        inflated_percent, rejected_percent       share of the updates
        lockout_s                                longest time from the first inflated update of a streak to its last

    A filter that drifts away and rejects every fix has a long lock-out. NaN without such an update.
    """

    reads: ClassVar[str] = "updates"

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values by column name."""
        updates = estimate.updates
        used, reported = used_and_reported(updates, recording)
        start_s = first_counted_s(recording.reference, estimate.index, counted)
        rows = (updates.t_s >= start_s) & np.isfinite(reported).any(axis=0) & ~np.isnan(used).all(axis=0)
        if not rows.any():
            return dict.fromkeys(("inflated_percent", "rejected_percent", "lockout_s"), np.nan)
        used, reported = used[:, rows], reported[:, rows]
        inflated = np.asarray((used > INFLATED * reported).any(axis=0))
        rejected = (~np.isfinite(used)).all(axis=0)
        return {
            "inflated_percent": 100 * float(inflated.mean()),
            "rejected_percent": 100 * float(rejected.mean()),
            "lockout_s": longest_streak_s(inflated, updates.t_s[rows]),
        }


def longest_streak_s(flags: BoolArray, t_s: FloatArray) -> float:
    """Return the longest time between the first and the last of flags that are set without a gap; 0 without any."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    begin, end = edges[::2], edges[1::2] - 1
    return float(np.max(t_s[end] - t_s[begin], initial=0.0))


def used_and_reported(updates: Updates, recording: Recording) -> tuple[FloatArray, FloatArray]:
    """Return (3, m) the variances used and reported of the position in each update; NaN where it had none."""
    used = np.ascontiguousarray(updates.R_diagonal[:, :3].T)  # over short rows NumPy is slow
    reported = np.full_like(used, np.nan)
    position = recording.position
    if position is None or len(position.t_s) == 0 or used.size == 0:
        return used, reported
    nearest = np.clip(np.searchsorted(position.t_s, updates.t_s - 1e-9), 0, len(position.t_s) - 1)
    same = np.abs(position.t_s[nearest] - updates.t_s) < 1e-6
    variances = np.diagonal(position.covariance_m2, axis1=1, axis2=2)[nearest[same]]
    reported[:, same] = np.maximum(variances.T, VARIANCE_FLOOR)
    return used, reported
