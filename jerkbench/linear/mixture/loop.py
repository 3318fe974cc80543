"""The loop of mixed filters: the steps of a timeline, one after the other."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import chosen, vectors
from jerkbench.kinematic.adapt import adapt_runs
from jerkbench.kinematic.arguments import SEEN, Kept, Rules, Runs, Score, Steps
from jerkbench.kinematic.correction import check_definite, correct, mirror
from jerkbench.kinematic.gain import mahalanobis
from jerkbench.kinematic.layout import AT, ENDED, KEPT, LOST, WIDTH, R, S, X, Y
from jerkbench.kinematic.loop import all_lost, ask_ahead, mark_axes
from jerkbench.kinematic.predict import predict
from jerkbench.kinematic.score import compare
from jerkbench.kinematic.trajectory import store
from jerkbench.kinematic.update_step import count, finish, innovate, notice, take_covariance
from jerkbench.linear.mixture.arguments import Mixing
from jerkbench.linear.mixture.layout import COUNT
from jerkbench.linear.mixture.mixing import combine, log_likelihood, mix, weigh


def run_mixture(steps: Steps, score: Score, mixing: Mixing, rules: Rules, kept: Kept, runs: Runs) -> tuple[int, int]:
    """Run all steps, or up to where the last run is lost; arguments as those of `jerkbench.kinematic.loop.run_steps`.

    The array of ``kept`` holds the combined state, and the sums.

    Returns:
        How many stamps of the reference were visited, and how many updates there were.
    """
    c, u, truth = vectors(kept.w, WIDTH), vectors(steps.u, WIDTH), vectors(score.truth, WIDTH)
    x, P = vectors(kept.x, WIDTH), vectors(kept.P, WIDTH)
    begin(mixing, c)
    states = updates = 0
    columns = mixing.x0.shape[1]
    for k in range(len(steps.model)):
        if steps.model[k] >= 0:
            ask_ahead(u, 3, steps.sample[k])
            for j in range(COUNT):
                move(mixing, j, steps.model[k], u, steps.sample[k])
        if steps.update[k] >= 0:
            update(c, steps, score, mixing, rules, kept, runs, steps.update[k], updates, columns)
            updates += 1
            if all_lost(kept.w):
                return states, updates
        if steps.reference[k] >= 0:
            kept.reference[states] = steps.reference[k]
            combine(mixing, c)
            if len(kept.x) > 0:
                store(c, x, P, states)
            if len(score.mark) > 0:
                ask_ahead(truth, 6, states)
                compare(c, score, truth, kept.errors, states)
            states += 1
    return states, updates


def begin(mixing: Mixing, c: FloatArray) -> None:
    """Put the states at the start into the arrays of the filters, which are zero."""
    for j in range(COUNT):
        w, x0, P0 = vectors(mixing.filters[j], WIDTH), vectors(mixing.x0[j], WIDTH), vectors(mixing.P0[j], WIDTH)
        mark_axes(w)
        for s in range(S):
            w[X + s] = x0[s]
            for t in range(S):
                w[AT[s, t]] = P0[S * s + t]
        if WIDTH == 1:
            mirror(w)
    c[ENDED] = c[ENDED] - 1.0


def move(mixing: Mixing, j: int, k: int, u: FloatArray, sample: int) -> None:
    """Predict filter ``j`` over a step of length number ``k``."""
    w = vectors(mixing.filters[j], WIDTH)
    if WIDTH == 1 or mixing.A.shape[3] == 1:
        shared = vectors(mixing.A[j], 1), vectors(mixing.b[j], 1), vectors(mixing.Q[j], 1)
        predict(w, shared, mixing.triangular, k, u, sample)
    else:
        own = vectors(mixing.A[j], WIDTH), vectors(mixing.b[j], WIDTH), vectors(mixing.Q[j], WIDTH)
        predict(w, own, mixing.triangular, k, u, sample)


def update(
    c: FloatArray,
    steps: Steps,
    score: Score,
    mixing: Mixing,
    rules: Rules,
    kept: Kept,
    runs: Runs,
    which: int,
    place: int,
    columns: int,
) -> None:
    """Adapt R by the combined prediction, update and weigh all filters, mix them."""
    seen, at = vectors(kept.seen, WIDTH), SEEN * place if len(kept.seen) > 1 else 0
    kept.which[place] = which
    combine(mixing, c)
    complete = innovate(c, vectors(steps.z, WIDTH), steps.z, which)
    take_covariance(c, vectors(steps.reported, WIDTH), which, complete)
    nis = mahalanobis(c)
    notice(c, seen, at, nis)
    if len(steps.R) > 0:
        take_covariance(c, vectors(steps.R, WIDTH), which, complete)
    same = adapt_runs(c, kept.w, runs, rules, complete)
    if not same or len(steps.R) > 0:
        nis = mahalanobis(c)
    finish(c, seen, at, nis)
    for j in range(COUNT):
        correct_filter(c, steps, mixing, j, which, columns)
    weigh(mixing)
    mix(mixing, c)
    if WIDTH == 1:
        for j in range(COUNT):
            mirror(vectors(mixing.filters[j], WIDTH))
    c[ENDED] = chosen(c[LOST] * (-0.5 - c[ENDED]), 0.0, float(which), c[ENDED])
    if len(score.counts) > 0:
        count(c, seen, at, vectors(score.counts, WIDTH)[which])


def correct_filter(c: FloatArray, steps: Steps, mixing: Mixing, j: int, which: int, columns: int) -> None:
    """Update filter ``j`` with the rows and the R of ``c``, and put its log likelihood into mu."""
    w, z = vectors(mixing.filters[j], WIDTH), vectors(steps.z, WIDTH)
    for e in range(36):
        w[R + e] = c[R + e]
    for r in range(6):
        w[KEPT + r] = c[KEPT + r]
        w[Y + r] = chosen(c[KEPT + r], 0.0, z[6 * which + r] - w[X + r], 0.0)
    distance = mahalanobis(w)
    log_likelihood(distance, mixing.filters[j], mixing.mu[j])
    correct(w, columns)
    check_definite(w)
    c[LOST] += w[LOST]
