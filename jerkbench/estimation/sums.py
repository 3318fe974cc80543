"""The sums of a run, step by step as it is computed; compiled."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, FloatMatrix, FloatVector, IntVector
from jerkbench.estimate import Updates
from jerkbench.streamed_run import Scoring, Streamed
from jerkbench.timeline.timeline import Timeline

TOTALS = (
    *("EAST", "NORTH", "UP", "VEAST", "VNORTH", "VUP", "WHOLE", "OUTAGE", "LARGEST", "FARTHEST"),
    *("NEES", "NEES_POSITION", "NIS", "UPDATES", "NIS_USED", "UPDATES_USED", "ODD"),
)
"""What is summed up over a run; LARGEST and FARTHEST are maxima of squares, ODD counts covariances that are none."""

EAST, NORTH, UP, VEAST, VNORTH, VUP, WHOLE, OUTAGE, LARGEST, FARTHEST = range(10)
NEES, NEES_POSITION, NIS, UPDATES, NIS_USED, UPDATES_USED, ODD = range(10, 17)

SEEN = 16
"""Numbers that are kept of what an update saw: rows, nis, rows kept, nis used, innovation (6), diagonal of R (6)."""


class Score(NamedTuple):
    """What the k visited rows of the reference count for, and the sums; nothing is scored where k is 0.

    Attributes:
        truth: (k, 6) as in `jerkbench.streamed_run.Scoring`, like the next four.
        counted: (k,) likewise.
        whole: (k,) likewise.
        moving: (k,) likewise.
        outage: (k,) likewise.
        mark: (k,) row of ``errors``, or -1.
        errors: (marks, 9) position errors, and the upper triangle of their covariance.
        counts: (rows of z,) 1 where an update counts, else 0.
        totals: (17,) the sums, in the order of TOTALS.
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


def score_of(scoring: Scoring | None, timeline: Timeline) -> Score:
    """Return what is needed to score a run; None: nothing is scored."""
    nothing, totals, room = np.empty(0), np.zeros(len(TOTALS)), np.zeros(42)
    if scoring is None:
        none = np.empty(0, dtype=np.int64)
        errors = np.empty((0, 9))
        return Score(np.empty((0, 6)), nothing, nothing, nothing, nothing, none, errors, nothing, totals, room)
    marks = np.unique(scoring.marks)
    mark = np.full(len(scoring.truth), -1, dtype=np.int64)
    mark[marks] = np.arange(len(marks))
    return Score(
        _plain(scoring.truth),
        _plain(scoring.counted),
        _plain(scoring.whole),
        _plain(scoring.moving),
        _plain(scoring.outage),
        mark,
        np.zeros((len(marks), 9)),
        (timeline.measurements.t_ns * 1e-9 >= scoring.start_s).astype(np.float64),
        totals,
        room,
    )


def _plain(array: FloatArray) -> FloatArray:
    return np.require(array, np.float64, ["C", "W", "A"])


def streamed_from(score: Score, scoring: Scoring, updates: Updates, euler_rad: FloatArray | None) -> Streamed | None:
    """Return the sums of a run; None where they are not finite, or a covariance was none."""
    totals = score.totals
    if not np.isfinite(totals).all() or totals[ODD] > 0:
        return None
    marked = score.errors[np.searchsorted(np.unique(scoring.marks), scoring.marks)]
    return Streamed(
        position_m2=totals[:3],
        velocity_m2ps2=totals[3:6],
        whole_m2=float(totals[WHOLE]),
        outage_m2=float(totals[OUTAGE]),
        largest_m2=float(totals[LARGEST]),
        farthest_m2=float(totals[FARTHEST]),
        nees=float(totals[NEES]),
        nees_position=float(totals[NEES_POSITION]),
        nis_per_row=float(totals[NIS]),
        nis_updates=float(totals[UPDATES]),
        nis_used_per_row=float(totals[NIS_USED]),
        nis_used_updates=float(totals[UPDATES_USED]),
        marked_m=marked[:, :3],
        marked_m2=marked[:, 3:],
        updates=updates,
        euler_rad=euler_rad,
    )


def add_state(score: Score, row: int, x: FloatArray, P: FloatArray) -> None:
    """Score position and velocity x (6,) with covariance P (36,) at visited row ``row``; nothing where none is."""
    if len(score.truth) == 0:
        return
    t, e = score.totals, score.room
    counted, moving = score.counted[row], score.moving[row]
    for s in range(6):
        e[36 + s] = x[s] - score.truth[row, s]
    for i in range(3):
        t[EAST + i] += counted * (e[36 + i] * e[36 + i])
        t[VEAST + i] += moving * (e[39 + i] * e[39 + i])
    square = e[36] * e[36] + e[37] * e[37] + e[38] * e[38]
    t[WHOLE] += score.whole[row] * square
    t[OUTAGE] += score.outage[row] * square
    t[FARTHEST] = max(t[FARTHEST], square)
    t[LARGEST] = max(t[LARGEST], counted * square)
    if score.mark[row] >= 0:
        _mark(score.errors[score.mark[row]], e, P)
    if not square < np.inf:
        t[ODD] += 1.0
    if counted > 0.0:
        _add_nees(t, e, P, moving)


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
            t[ODD] += 1.0
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
    t[NEES] += moving * total


def add_update(score: Score, which: int, seen: FloatArray) -> None:
    """Count an update of row ``which`` of z, of which ``seen`` (SEEN,) is kept."""
    if len(score.truth) == 0 or score.counts[which] == 0.0:
        return
    t = score.totals
    if seen[0] > 0.0:
        t[NIS] += seen[1] / seen[0]
        t[UPDATES] += 1.0
    if seen[2] > 0.0:
        t[NIS_USED] += seen[3] / seen[2]
        t[UPDATES_USED] += 1.0
