"""The loop of the kernel: the steps of a timeline, one after the other."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import fetch
from jerkbench.compilation.vectors import vectors
from jerkbench.kinematic.arguments import Kept, Model, Rules, Runs, Score, Steps
from jerkbench.kinematic.correction import mirror
from jerkbench.kinematic.layout import AT, AXES, DENSE, ENDED, LOST, SAME, WIDTH, S, X
from jerkbench.kinematic.predict import predict
from jerkbench.kinematic.prior import advance
from jerkbench.kinematic.score import compare
from jerkbench.kinematic.trajectory import store
from jerkbench.kinematic.update_step import update

AHEAD = 64
"""So many rows before it is needed the memory is asked for it: about ten microseconds."""


def run_steps(steps: Steps, score: Score, model: Model, rules: Rules, kept: Kept, runs: Runs) -> tuple[int, int]:
    """Run all steps, or up to where the last run is lost.

    Args:
        steps: the steps.
        score: what the errors count for.
        model: the filter.
        rules: the adaptation.
        kept: gets what comes out.
        runs: room.

    Returns:
        How many stamps of the reference were visited, and how many updates there were.
    """
    w, u, truth = vectors(kept.w, WIDTH), vectors(steps.u, WIDTH), vectors(score.truth, WIDTH)
    x, P = vectors(kept.x, WIDTH), vectors(kept.P, WIDTH)
    start(w, vectors(steps.x0, WIDTH), vectors(steps.P0, WIDTH), vectors(model.extra, WIDTH))
    shared = vectors(model.A, 1), vectors(model.b, 1), vectors(model.Q, 1)
    own = vectors(model.A, WIDTH), vectors(model.b, WIDTH), vectors(model.Q, WIDTH)
    states = updates = begun = 0
    columns = 3 * (2 + len(model.extra))
    for k in range(len(steps.model)):
        if steps.model[k] >= 0:
            ask_ahead(u, 3, steps.sample[k])
            if WIDTH == 1 or model.A.shape[2] == 1:
                predict(w, shared, model.triangular, steps.model[k], u, steps.sample[k])
            else:
                predict(w, own, model.triangular, steps.model[k], u, steps.sample[k])
        if steps.update[k] >= 0:
            if DENSE == 1:
                advance(runs, model, steps, begun, k + 1)
                begun = k + 1
            update(w, steps, score, rules, kept, runs, steps.update[k], updates, columns)
            updates += 1
            if all_lost(kept.w):
                return states, updates
        if steps.reference[k] >= 0:
            kept.reference[states] = steps.reference[k]
            if len(kept.x) > 0:
                store(w, x, P, states)
            if len(score.mark) > 0:
                ask_ahead(truth, 6, states)
                compare(w, score, truth, kept.errors, states)
            states += 1
    return states, updates


def ask_ahead(array: FloatArray, length: int, row: int) -> None:
    """Ask for a row of ``length`` vectors that a later step will read; a single run's numbers come by themselves."""
    if WIDTH > 1:
        for e in range(length):
            fetch(array, length * (row + AHEAD) + e)


def all_lost(w: FloatArray) -> bool:
    """Whether no run is left."""
    run = 0
    while run < WIDTH and w[WIDTH * LOST + run] > 0.0:
        run += 1
    return run == WIDTH


def start(w: FloatArray, x0: FloatArray, P0: FloatArray, extra: FloatArray) -> None:
    """Put the initial state and covariance into w, which is zero."""
    for s in range(6):
        w[X + s] = x0[s]
        for t in range(6):
            w[AT[s, t]] = P0[6 * s + t]
            w[AT[t, s]] = P0[6 * s + t]
    for s in range(6, S):
        w[AT[s, s]] = extra[(s - 6) // 3]
    w[ENDED] = w[ENDED] - 1.0
    if WIDTH == 1:
        mirror(w)
    mark_axes(w)


def mark_axes(w: FloatArray) -> None:
    """Note which pairs of axes are one axis with itself, where all pairs are predicted alike."""
    if WIDTH == 1:
        for p in range(len(AXES)):
            w[SAME + p] = 1.0 if AXES[p][0] == AXES[p][1] else 0.0
