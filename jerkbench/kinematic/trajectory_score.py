"""Computation of the error sums of a run from its trajectory.

A trajectory may contain NaN at time stamps whose errors are not scored. In a run without a stored trajectory, no state
may be NaN.
"""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.estimate import (
    MAX_ERROR,
    NEES,
    NEES_POSITION,
    NIS,
    NIS_USED,
    OUTAGE,
    POSITION_SQUARES,
    SUMS,
    UPDATES,
    UPDATES_USED,
    VELOCITY_SQUARES,
    WITH_BURN_IN,
    ErrorWeights,
    Estimate,
    Streamed,
    Updates,
)

UPPER = np.triu_indices(3)


@np.errstate(all="ignore")
def scored_trajectory(estimate: Estimate, scoring: ErrorWeights) -> Streamed:
    """Return the error sums of a trajectory. A sum is NaN if one of the scored errors is NaN."""
    k, sums = len(estimate.index), np.zeros(SUMS)
    errors = np.hstack([estimate.position_m, estimate.velocity_mps]) - scoring.truth[:k]
    counted, with_burn_in, moving, outage = (
        weights[:k] > 0.0 for weights in (scoring.counted, scoring.with_burn_in, scoring.moving, scoring.outage)
    )
    square = (errors[:, :3] ** 2).sum(axis=1)
    sums[POSITION_SQUARES : POSITION_SQUARES + 3] = (errors[counted, :3] ** 2).sum(axis=0)
    sums[VELOCITY_SQUARES : VELOCITY_SQUARES + 3] = (errors[moving, 3:] ** 2).sum(axis=0)
    sums[WITH_BURN_IN], sums[OUTAGE] = square[with_burn_in].sum(), square[outage].sum()
    sums[MAX_ERROR] = square[counted].max(initial=0.0)
    position, both = _squared_distances(errors[counted], estimate.covariance[counted])
    sums[NEES_POSITION], sums[NEES] = position.sum(), both[moving[counted]].sum()
    _add_updates(sums, estimate.updates, scoring.start_s)
    marked = np.zeros((len(scoring.marks), 9))
    reached = scoring.marks < k
    rows = scoring.marks[reached]
    marked[reached] = np.hstack([errors[rows, :3], estimate.covariance[rows][:, UPPER[0], UPPER[1]]])
    return Streamed.of(sums, marked, estimate.updates, estimate.euler_rad)


def _squared_distances(errors: FloatArray, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the NEES (n,) of position, and of position and velocity, with NaN if P is not positive definite."""
    C, e = covariance.transpose(1, 2, 0).copy(), errors.T.copy()
    total = np.zeros(len(errors))
    for c in range(6):
        pivot = np.where(C[c, c] > 0.0, C[c, c], np.nan)
        total = total + e[c] * e[c] / pivot
        for r in range(c + 1, 6):
            factor = C[r, c] / pivot
            e[r] -= factor * e[c]
            C[r, c + 1 :] -= factor * C[c, c + 1 :]
        if c == 2:
            position = total
    return position, total


def _add_updates(sums: FloatArray, updates: Updates, start_s: float) -> None:
    """Add the NIS per measurement row to the sums, with the reported R and with the R and rows after the adaptation."""
    used_rows = updates.rows - np.isinf(updates.R_diagonal).sum(axis=1)
    for rows, nis, total, count in (
        (updates.rows, updates.nis, NIS, UPDATES),
        (used_rows, updates.nis_used, NIS_USED, UPDATES_USED),
    ):
        counts = (updates.t_s >= start_s) & (rows > 0)
        sums[total], sums[count] = (nis[counts] / rows[counts]).sum(), counts.sum()
