"""The loop of mixed filters: the steps of a timeline, one after the other."""

from jerkbench.compilation.vectors import chosen
from jerkbench.compilation.views import Run, row, runs_in
from jerkbench.kinematic.arguments import Kept, Rules, Runs, Score, Steps
from jerkbench.kinematic.correction import check_definite, correct
from jerkbench.kinematic.gain import mahalanobis
from jerkbench.kinematic.layout import RUN
from jerkbench.kinematic.loop import all_lost, keep, move_by
from jerkbench.kinematic.predict import mark_axes, mirror
from jerkbench.kinematic.update_step import expect, finish, seen_of
from jerkbench.linear.mixture.arguments import Mixing
from jerkbench.linear.mixture.mixing import combine, log_likelihood, mix, weigh


def run_mixture(steps: Steps, score: Score, mixing: Mixing, rules: Rules, kept: Kept, runs: Runs) -> tuple[int, int]:
    """Run all steps, or up to where the last run is lost; arguments as those of `jerkbench.kinematic.loop.run_steps`.

    The array of ``kept`` holds the combined state, and the sums.

    Returns:
        How many stamps of the reference were visited, and how many updates there were.
    """
    combined = runs_in(kept.w, RUN)
    begin(mixing, combined)
    reached = updates = 0
    states = mixing.x0.shape[1]
    for k in range(len(steps.model)):
        for j in range(combined.count):
            models = mixing.A[j], mixing.b[j], mixing.Q[j]
            move_by(runs_in(mixing.filters[j], RUN), steps, models, mixing.triangular, k)
        if steps.update[k] >= 0:
            update(combined, steps, score, mixing, rules, kept, runs, steps.update[k], updates, states)
            updates += 1
            if all_lost(combined):
                return reached, updates
        if steps.reference[k] >= 0:
            combine(mixing, combined)
            keep(combined, score, kept, steps.reference[k], reached)
            reached += 1
    return reached, updates


def begin(mixing: Mixing, combined: Run) -> None:
    """Put the states at the start into the arrays of the filters, which are zero."""
    for j in range(combined.count):
        run = runs_in(mixing.filters[j], RUN)
        x0, P0 = row(mixing.x0, j, run, "s"), row(mixing.P0, j, run, "s s")
        for s in range(run.s):
            run.x[s] = x0[s]
            for t in range(run.s):
                run.P[s, t] = P0[s, t]
        mirror(run)
        mark_axes(run)
    combined.ended = combined.ended - 1.0


def update(
    combined: Run,
    steps: Steps,
    score: Score,
    mixing: Mixing,
    rules: Rules,
    kept: Kept,
    runs: Runs,
    which: int,
    place: int,
    states: int,
) -> None:
    """Adapt R by the combined prediction, update and weigh all filters, mix them."""
    seen = seen_of(combined, kept, place)
    kept.which[place] = which
    combine(mixing, combined)
    nis = expect(combined, steps, rules, runs, seen, which)
    rows = combined.used[0]
    for r in range(1, 6):
        rows += combined.used[r]
    for j in range(combined.count):
        correct_filter(combined, runs_in(mixing.filters[j], RUN), steps, mixing, j, which, states)
    weigh(mixing)
    mix(mixing, combined, rows)
    for j in range(combined.count):
        mirror(runs_in(mixing.filters[j], RUN))
    finish(combined, seen, score, which, nis)


def correct_filter(combined: Run, run: Run, steps: Steps, mixing: Mixing, j: int, which: int, states: int) -> None:
    """Update filter ``j`` with the rows and the R of the mixture, and put its log likelihood into mu."""
    z = row(steps.z, which, run, "6")
    for r in range(6):
        for c in range(6):
            run.R[r, c] = combined.R[r, c]
        run.used[r] = combined.used[r]
        run.y[r] = chosen(run.used[r], 0.0, z[r] - run.x[r], 0.0)
    log_likelihood(run, mahalanobis(run), mixing.mu, j)
    correct(run, states)
    check_definite(run)
    combined.lost += run.lost
