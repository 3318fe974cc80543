"""An update: what was measured, what the adaptation makes of it, what is kept of it, and how it counts."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import chosen
from jerkbench.compilation.views import RunView, View, ask_for, row
from jerkbench.kinematic.adapt import adapt_runs
from jerkbench.kinematic.arguments import Kept, Rules, Runs, Score, Steps
from jerkbench.kinematic.correction import NAN, check_definite, correct, determinant, mahalanobis
from jerkbench.kinematic.layout import DENSE
from jerkbench.kinematic.predict import mirror
from jerkbench.kinematic.whole_matrices import find_gains, put_gains


def update(
    run: RunView, steps: Steps, score: Score, rules: Rules, kept: Kept, runs: Runs, which: int, place: int, states: int
) -> None:
    """Take row ``which`` of the measurements, the ``place``-th update, of filters with so many ``states``."""
    seen = seen_of(run, kept, place)
    kept.which[place] = which
    nis = expect(run, steps, rules, runs, seen, which)
    if DENSE == 1:
        find_gains(run, runs, rules)
    correct(run, states)
    if DENSE == 1:
        put_gains(run, runs)
        mirror(run)
    check_definite(run)
    finish(run, seen, score, which, nis)


def seen_of(run: RunView, kept: Kept, place: int) -> View:
    """Return where what the ``place``-th update sees is kept."""
    seen: View = row(kept.seen, place if len(kept.seen) > 1 else 0, run, "17")
    return seen


def expect(run: RunView, steps: Steps, rules: Rules, runs: Runs, seen: View, which: int) -> float:
    """Fill innovation and adapted R; return y' S^-1 y with it."""
    complete = _innovate(run, row(steps.z, which, run, "6"), steps.z, which)
    _take_covariance(run, row(steps.reported, which, run, "6 6"), complete)
    if run.width > 1:
        ask_for(row(steps.reported, which + 1, run, "6 6"))
    nis = mahalanobis(run)
    seen[0], seen[1], seen[16] = _rows_used(run), nis, determinant(run)
    for r in range(6):
        seen[4 + r] = chosen(run.used[r], 0.0, run.y[r], NAN)
    if len(steps.R) > 0:
        _take_covariance(run, row(steps.R, which, run, "6 6"), complete)
    same = adapt_runs(run, runs, rules, complete)
    if not same or len(steps.R) > 0:
        nis = mahalanobis(run)
    return nis


def _innovate(run: RunView, z: View, numbers: FloatArray, which: int) -> bool:
    """Make y = z - H x; return whether all rows of all runs are there."""
    absent = 0.0
    for r in range(6):
        run.used[r] = chosen(1.0, z[r] * 0.0, 1.0, 0.0)
        run.y[r] = chosen(run.used[r], 0.0, z[r] - run.x[r], 0.0)
        for k in range(run.width):
            absent += numbers[which, r, k] * 0.0
    return absent == 0.0


def _take_covariance(run: RunView, R: View, complete: bool) -> None:
    """Take R, 0 where a row is not there."""
    for r in range(6):
        for c in range(6):
            run.R[r, c] = R[r, c]
    if not complete:
        clear_absent(run)


def clear_absent(run: RunView) -> None:
    """Make R zero where a row is not there."""
    for r in range(6):
        for c in range(6):
            run.R[r, c] = chosen(run.used[r] * run.used[c], 0.0, run.R[r, c], 0.0)


def finish(run: RunView, seen: View, score: Score, which: int, nis: float) -> None:
    """Keep what the adapted R made of it, and count the update."""
    seen[2] = _rows_used(run)
    seen[3] = chosen(seen[2], 0.0, nis, NAN)
    for r in range(6):
        seen[10 + r] = run.variance[r]
    if len(score.counts) > 0:
        counts = row(score.counts, which, run, "1")[0]
        run.nis += chosen(seen[0], 0.0, counts * seen[1] / seen[0], 0.0)
        run.updates += chosen(seen[0], 0.0, counts, 0.0)
        run.nis_used += chosen(seen[2], 0.0, counts * seen[3] / seen[2], 0.0)
        run.updates_used += chosen(seen[2], 0.0, counts, 0.0)


def _rows_used(run: RunView) -> float:
    rows: float = run.used[0]
    for r in range(1, 6):
        rows += run.used[r]
    return rows
