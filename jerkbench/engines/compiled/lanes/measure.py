"""An update of several runs: what was measured, what is kept of it, and how it counts."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import fetch
from jerkbench.compilation.vectors import chosen, vectors
from jerkbench.engines.compiled.arguments import Packed, Rule
from jerkbench.engines.compiled.gain import mahalanobis
from jerkbench.engines.compiled.lanes.adapt import adapt_runs
from jerkbench.engines.compiled.lanes.arguments import SEEN, LaneKept, LaneSteps
from jerkbench.engines.compiled.lanes.places import NIS, NIS_USED, UPDATES, UPDATES_USED, VARIANCE
from jerkbench.engines.compiled.lanes.update import check_definite, correct
from jerkbench.engines.compiled.places import KEPT, R, X, Y


def update(
    w: FloatArray, steps: LaneSteps, rule: Rule, kept: LaneKept, packed: Packed, which: int, columns: int
) -> None:
    """Take row ``which`` of the measurements.

    Args:
        w: the runs.
        steps: what they share.
        rule: the adaptation; each run has its own memory, not that of ``rule``.
        kept: gets what the update saw.
        packed: room.
        which: number of the update.
        columns: number of states. As a constant it would make the compiler unroll the loops, and use the stack for
            what no longer fits into registers.
    """
    seen, reported = vectors(kept.seen), vectors(steps.reported)
    at = which if len(kept.seen) > 1 else 0
    measure(w, vectors(steps.z), vectors(steps.kept), reported, which)
    for e in range(21):
        fetch(reported, 21 * (which + 1) + e)
    notice(w, seen, at)
    if len(steps.R):
        take_covariance(w, vectors(steps.R), which)
    adapt_runs(w, kept.w, kept.runs, packed, rule, kept.memory, steps.complete[which] != 0)
    finish(w, seen, at, vectors(steps.late)[which], columns)


def measure(w: FloatArray, z: FloatArray, kept: FloatArray, reported: FloatArray, which: int) -> None:
    """Take row ``which`` of the measurements: innovation, and R as the receiver reported it."""
    for r in range(6):
        w[KEPT + r] = kept[6 * which + r]
        w[Y + r] = (z[6 * which + r] - w[X + r]) * w[KEPT + r]
    take_covariance(w, reported, which)


def take_covariance(w: FloatArray, triangles: FloatArray, which: int) -> None:
    """Fill R from row ``which`` of lower triangles."""
    e = 21 * which
    for r in range(6):
        for c in range(r + 1):
            w[R + 6 * r + c] = triangles[e]
            w[R + 6 * c + r] = triangles[e]
            e += 1


def notice(w: FloatArray, seen: FloatArray, row: int) -> None:
    """Keep what the receiver's R makes of the innovation in row ``row`` of ``seen``."""
    seen[SEEN * row] = _rows(w)
    seen[SEEN * row + 1] = mahalanobis(w)
    for r in range(6):
        seen[SEEN * row + 4 + r] = w[Y + r]


def finish(w: FloatArray, seen: FloatArray, row: int, counts: float, columns: int) -> None:
    """Update with the adapted R, and count it where ``counts`` is 1."""
    at = SEEN * row
    seen[at + 2] = _rows(w)
    for r in range(6):
        seen[at + 10 + r] = w[VARIANCE + r]
    seen[at + 3] = correct(w, columns)
    check_definite(w)
    for total, number, j in ((NIS, UPDATES, 0), (NIS_USED, UPDATES_USED, 2)):
        w[total] += chosen(seen[at + j], 0.0, counts * seen[at + j + 1] / seen[at + j], 0.0)
        w[number] += chosen(seen[at + j], 0.0, counts, 0.0)


def _rows(w: FloatArray) -> float:
    """How many rows are kept."""
    rows: float = w[KEPT]
    for r in range(1, 6):
        rows += w[KEPT + r]
    return rows
