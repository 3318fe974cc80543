"""The sums of a run from its trajectory, compiled where numba may compile.

Unlike a run side by side it may hold numbers that are none, where they do not count.
"""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, FloatMatrix, FloatVector, IntVector
from jerkbench.compilation.compiled_loop import compiled_loop
from jerkbench.compilation.module_cache import can_compile
from jerkbench.estimate import (
    LARGEST,
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
    WHOLE,
    ErrorWeights,
    Estimate,
    Streamed,
)


class TrajectoryScore(NamedTuple):
    """What the k visited rows of the reference count for, and the sums.

    Attributes:
        truth: (k, 6) as in `jerkbench.estimate.ErrorWeights`, like the next four.
        counted: (k,) likewise.
        whole: (k,) likewise.
        moving: (k,) likewise.
        outage: (k,) likewise.
        mark: (k,) row of ``errors``, or -1.
        errors: (marks, 9) position errors, and the upper triangle of their covariance.
        counts: (rows of z,) 1 where an update counts, else 0.
        totals: (SUMS,) the sums.
        room: (42,) for an elimination.
    """

    truth: FloatMatrix
    counted: FloatVector
    whole: FloatVector
    moving: FloatVector
    outage: FloatVector
    mark: IntVector
    errors: FloatMatrix
    counts: FloatVector
    totals: FloatVector
    room: FloatVector


def _score_of(scoring: ErrorWeights, update_s: FloatArray) -> TrajectoryScore:
    """What is needed to score a run with updates at ``update_s`` (m,)."""
    marks = np.unique(scoring.marks)
    mark = np.full(len(scoring.truth), -1, dtype=np.int64)
    mark[marks] = np.arange(len(marks))
    weights = map(_plain, (scoring.truth, scoring.counted, scoring.whole, scoring.moving, scoring.outage))
    counts = (update_s >= scoring.start_s).astype(np.float64)
    return TrajectoryScore._make([*weights, mark, np.zeros((len(marks), 9)), counts, np.zeros(SUMS), np.zeros(42)])


def _plain(array: FloatArray) -> FloatArray:
    return np.require(array, np.float64, ["C", "W", "A"])


def scored_trajectory(estimate: Estimate, scoring: ErrorWeights) -> Streamed:
    """Return the sums of a trajectory; what is no number in it is none in them, where it counts."""
    updates = estimate.updates
    kept = updates.rows - np.isinf(updates.R_diagonal).sum(axis=1)
    seen = np.column_stack([updates.rows, updates.nis, kept, updates.nis_used])
    score, x = _score_of(scoring, updates.t_s), np.hstack([estimate.position_m, estimate.velocity_mps])
    with np.errstate(all="ignore"):
        _compiled()(score, x, _plain(estimate.covariance.reshape(-1, 36)), seen)
    marked = score.errors[np.searchsorted(np.unique(scoring.marks), scoring.marks)]
    return Streamed.of(score.totals, marked, updates, estimate.euler_rad)


@cache
def _compiled() -> Callable[..., None]:
    """The loop over the rows of a trajectory, compiled where numba may compile."""
    return compiled_loop(add_trajectory, "the score of a trajectory") if can_compile() else add_trajectory


def add_trajectory(score: TrajectoryScore, x: FloatMatrix, P: FloatMatrix, seen: FloatMatrix) -> None:
    """Score all rows of x (k, 6) and P (k, 36), and count all updates, of which ``seen`` (m, 4) is kept."""
    for row in range(len(x)):
        add_state(score, row, x[row], P[row])
    for which in range(len(seen)):
        add_update(score, which, seen[which])


def add_state(score: TrajectoryScore, row: int, x: FloatArray, P: FloatArray) -> None:
    """Score position and velocity x (6,) with covariance P (36,) at visited row ``row``."""
    t, e = score.totals, score.room
    for s in range(6):
        e[36 + s] = x[s] - score.truth[row, s]
    _add_squares(score, row, e[36] * e[36] + e[37] * e[37] + e[38] * e[38])
    if score.mark[row] >= 0:
        _mark(score.errors[score.mark[row]], e, P)
    if score.counted[row] > 0.0:
        _add_nees(t, e, P, score.moving[row])


def _add_squares(score: TrajectoryScore, row: int, square: float) -> None:
    """Add the squares of the errors; ``square`` is that of the position."""
    t, e = score.totals, score.room
    if score.counted[row] > 0.0:
        for i in range(3):
            t[POSITION_SQUARES + i] += e[36 + i] * e[36 + i]
        if t[LARGEST] == t[LARGEST] and not square <= t[LARGEST]:
            t[LARGEST] = square
    if score.moving[row] > 0.0:
        for i in range(3):
            t[VELOCITY_SQUARES + i] += e[39 + i] * e[39 + i]
    if score.whole[row] > 0.0:
        t[WHOLE] += square
    if score.outage[row] > 0.0:
        t[OUTAGE] += square


def _mark(kept: FloatArray, e: FloatArray, P: FloatArray) -> None:
    """Keep the position error of a row, and the upper triangle of its covariance."""
    for i in range(3):
        kept[i] = e[36 + i]
        kept[3 + i] = P[i]
    kept[6], kept[7], kept[8] = P[7], P[8], P[14]


def _add_nees(t: FloatArray, C: FloatArray, P: FloatArray, moving: float) -> None:
    """Add e' P^-1 e of position, and of position and velocity where that counts, by elimination; e is C[36:]."""
    for k in range(36):
        C[k] = P[k]
    total = 0.0
    for c in range(6):
        if not C[7 * c] > 0.0:
            C[7 * c] = np.nan
        scale = 1.0 / C[7 * c]
        scaled = C[36 + c] * scale
        total += C[36 + c] * scaled
        for r in range(c + 1, 6):
            C[36 + r] -= C[6 * r + c] * scaled
            factor = C[6 * r + c] * scale
            for j in range(c + 1, 6):
                C[6 * r + j] -= factor * C[6 * c + j]
        if c == 2:
            t[NEES_POSITION] += total
    if moving > 0.0:
        t[NEES] += total


def add_update(score: TrajectoryScore, which: int, seen: FloatArray) -> None:
    """Count an update of row ``which`` of z, of which ``seen`` (4,) is kept."""
    if score.counts[which] == 0.0:
        return
    t = score.totals
    if seen[0] > 0.0:
        t[NIS] += seen[1] / seen[0]
        t[UPDATES] += 1.0
    if seen[2] > 0.0:
        t[NIS_USED] += seen[3] / seen[2]
        t[UPDATES_USED] += 1.0
