"""An update: what was measured, what the adaptation makes of it, what is kept of it, and how it counts."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import fetch
from jerkbench.compilation.vectors import chosen, vectors
from jerkbench.kinematic.adapt import adapt_runs
from jerkbench.kinematic.arguments import SEEN, Kept, Rules, Runs, Score, Steps
from jerkbench.kinematic.correction import check_definite, correct, mirror
from jerkbench.kinematic.gain import NAN, determinant, mahalanobis
from jerkbench.kinematic.layout import (
    DENSE,
    ENDED,
    KEPT,
    LOST,
    NIS,
    NIS_USED,
    UPDATES,
    UPDATES_USED,
    VARIANCE,
    WIDTH,
    R,
    X,
    Y,
)
from jerkbench.kinematic.own_gain import find_gains, put_gains


def update(
    w: FloatArray,
    steps: Steps,
    score: Score,
    rules: Rules,
    kept: Kept,
    runs: Runs,
    which: int,
    place: int,
    columns: int,
) -> None:
    """Take row ``which`` of the measurements, the ``place``-th update."""
    seen, reported = vectors(kept.seen, WIDTH), vectors(steps.reported, WIDTH)
    at = SEEN * place if len(kept.seen) > 1 else 0
    kept.which[place] = which
    complete = innovate(w, vectors(steps.z, WIDTH), steps.z, which)
    take_covariance(w, reported, which, complete)
    if WIDTH > 1:
        for e in range(36):
            fetch(reported, 36 * (which + 1) + e)
    nis = mahalanobis(w)
    notice(w, seen, at, nis)
    if len(steps.R) > 0:
        take_covariance(w, vectors(steps.R, WIDTH), which, complete)
    same = adapt_runs(w, kept.w, runs, rules, complete)
    if not same or len(steps.R) > 0:
        nis = mahalanobis(w)
    if DENSE == 1:
        find_gains(kept.w, runs, rules)
    correct(w, columns)
    if DENSE == 1:
        put_gains(kept.w, runs)
        if WIDTH == 1:
            mirror(w)
    check_definite(w)
    finish(w, seen, at, nis)
    w[ENDED] = chosen(w[LOST] * (-0.5 - w[ENDED]), 0.0, float(which), w[ENDED])
    if len(score.counts) > 0:
        count(w, seen, at, vectors(score.counts, WIDTH)[which])


def innovate(w: FloatArray, z: FloatArray, numbers: FloatArray, which: int) -> bool:
    """Fill y and kept from row ``which`` of z; return whether all rows of all runs are there."""
    for r in range(6):
        w[KEPT + r] = chosen(1.0, z[6 * which + r] * 0.0, 1.0, 0.0)
        w[Y + r] = chosen(w[KEPT + r], 0.0, z[6 * which + r] - w[X + r], 0.0)
    absent = 0.0
    for r in range(6):
        for run in range(WIDTH):
            absent += numbers[which, r, run] * 0.0
    return absent == 0.0


def take_covariance(w: FloatArray, covariances: FloatArray, which: int, complete: bool) -> None:
    """Fill R from row ``which`` of ``covariances``, 0 where a row is not there."""
    for e in range(36):
        w[R + e] = covariances[36 * which + e]
    if not complete:
        clear_absent(w)


def clear_absent(w: FloatArray) -> None:
    """Make R zero where a row is not there."""
    for r in range(6):
        for c in range(6):
            w[R + 6 * r + c] = chosen(w[KEPT + r] * w[KEPT + c], 0.0, w[R + 6 * r + c], 0.0)


def notice(w: FloatArray, seen: FloatArray, at: int, nis: float) -> None:
    """Keep the innovation, and what the receiver's R makes of it, from number ``at`` of ``seen``."""
    seen[at] = _rows(w)
    seen[at + 1] = nis
    seen[at + 16] = determinant(w)
    for r in range(6):
        seen[at + 4 + r] = chosen(w[KEPT + r], 0.0, w[Y + r], NAN)


def finish(w: FloatArray, seen: FloatArray, at: int, nis: float) -> None:
    """Keep what the adapted R made of it."""
    seen[at + 2] = _rows(w)
    seen[at + 3] = chosen(seen[at + 2], 0.0, nis, NAN)
    for r in range(6):
        seen[at + 10 + r] = w[VARIANCE + r]


def count(w: FloatArray, seen: FloatArray, at: int, counts: float) -> None:
    """Add the update to the sums where ``counts`` is 1."""
    for total, number, j in ((NIS, UPDATES, 0), (NIS_USED, UPDATES_USED, 2)):
        w[total] += chosen(seen[at + j], 0.0, counts * seen[at + j + 1] / seen[at + j], 0.0)
        w[number] += chosen(seen[at + j], 0.0, counts, 0.0)


def _rows(w: FloatArray) -> float:
    """How many rows are used."""
    rows: float = w[KEPT]
    for r in range(1, 6):
        rows += w[KEPT + r]
    return rows
