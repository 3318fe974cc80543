"""Several kinematic filters mixed at each update; `jerkbench.filters.imm` has the equations.

From Python: timelines in, an estimate with its trajectory or sums out. The compiled loop is in `mixing`.
"""

import math
from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import WIDE, FloatArray, FloatCube, FloatMatrix, FloatStack
from jerkbench.compilation.compiled_loop import compiled_loop
from jerkbench.compilation.vectors import aligned_zeros, chosen
from jerkbench.compilation.views import Lanes, View, lane, room, row, runs_in, taken
from jerkbench.contracts import Filter
from jerkbench.estimate import Estimate, Streamed
from jerkbench.kinematic.arguments import RUN, Exchange, Kept, Rules, Steps, TruthRows, run_type
from jerkbench.kinematic.correction import check_definite, correct, mahalanobis
from jerkbench.kinematic.loop import APART, all_lost, expect, finish, move, rows_used, runs_of
from jerkbench.kinematic.packs import Pack, model_of
from jerkbench.kinematic.plugin_call import Rule
from jerkbench.kinematic.predict import mark_axes, mirror
from jerkbench.kinematic.runs import run_alone, run_packs
from jerkbench.kinematic.score import keep
from jerkbench.timeline import Run, Timeline

# Arguments of the loop besides those of its filters; WIDTH is the number of runs side by side.


class Mixing(NamedTuple):
    """The filters that are mixed, and how; an axis L is WIDTH, or 1 where the runs have the same.

    Attributes:
        A: (COUNT, k, N N, L) of one axis, for each length of a step.
        b: (COUNT, k, N, L) likewise.
        Q: (COUNT, k, N N, L) likewise.
        triangular: whether every A is upper triangular with ones on its diagonal.
        x0: (COUNT, 3 N, WIDTH) mixed states at the start.
        P0: (COUNT, 9 N N, WIDTH) their covariances.
        transitions: (COUNT COUNT, WIDTH) Pi, row by row.
        weights: (COUNT, WIDTH) c, changed in place.
        mu: (COUNT, WIDTH) room for the probabilities.
        filters: (COUNT, LENGTH WIDTH) the arrays in which the filters live.
    """

    A: FloatStack
    b: FloatStack
    Q: FloatStack
    triangular: bool
    x0: FloatCube
    P0: FloatCube
    transitions: FloatMatrix
    weights: FloatMatrix
    mu: FloatMatrix
    filters: FloatMatrix


def combine(mixing: Mixing, into: Lanes) -> None:
    """Put mean and covariance of position and velocity of the mixture into the run ``into``."""
    weights, apart = row(mixing.weights, 0, into, "count"), room(into, "count 6")
    for s in range(6):  # sum_j c_j x_j
        mean = weights[0] * runs_in(mixing.filters[0], RUN).x[s]
        for j in range(1, into.count):
            mean += weights[j] * runs_in(mixing.filters[j], RUN).x[s]
        into.x[s] = mean
        for j in range(into.count):
            apart[j, s] = runs_in(mixing.filters[j], RUN).x[s] - mean
    for s in range(6):  # sum_j c_j (P_j + (x_j - x) (x_j - x)')
        for t in range(s + 1):
            total = weights[0] * (runs_in(mixing.filters[0], RUN).P[s, t] + apart[0, s] * apart[0, t])
            for j in range(1, into.count):
                total += weights[j] * (runs_in(mixing.filters[j], RUN).P[s, t] + apart[j, s] * apart[j, t])
            into.P[s, t] = total


def log_likelihood(run: Lanes, distance: float, mu: FloatArray, j: int) -> None:
    """Put log N(y; 0, S) of filter ``j`` into ``mu``, but for what all filters have in common.

    ``distance`` is y' S^-1 y; the run has the reciprocals of D of S = L D L'.
    """
    row(mu, j, run, "1")[0] = distance
    for k in range(run.width):
        alone = lane(run, k)
        position = alone.over_D[0] * alone.over_D[1] * alone.over_D[2]
        velocity = alone.over_D[3] * alone.over_D[4] * alone.over_D[5]
        mu[j, k] = 0.5 * (math.log(position) + math.log(velocity) - mu[j, k])


def weigh(mixing: Mixing) -> None:
    """Log likelihoods in mu become probabilities; the largest is taken out first, so that none underflows alone."""
    mu, weights = mixing.mu, mixing.weights
    for k in range(mu.shape[1]):
        largest, total = mu[0, k], 0.0
        for j in range(1, len(mu)):
            largest = max(largest, mu[j, k])
        for j in range(len(mu)):
            mu[j, k] = weights[j, k] * math.exp(mu[j, k] - largest)
            total += mu[j, k]
        for j in range(len(mu)):
            mu[j, k] /= total


def mix(mixing: Mixing, run: Lanes, rows: float) -> None:
    """Mix the states by mu and Pi in the runs that have used one of their ``rows``; the others stay as they are."""
    mu, weights = row(mixing.mu, 0, run, "count"), row(mixing.weights, 0, run, "count")
    transitions = row(mixing.transitions, 0, run, "count count")
    joint, mean = room(run, "count count"), room(run, "count s")
    for j in range(run.count):
        total = transitions[0, j] * mu[0]
        for i in range(1, run.count):
            total += transitions[i, j] * mu[i]
        weights[j] = chosen(rows, 0.0, total, weights[j])
        for i in range(run.count):
            same = 1.0 if i == j else 0.0
            joint[i, j] = chosen(rows, 0.0, transitions[i, j] * mu[i] / total, same)
    for s in range(run.s):
        for j in range(run.count):
            mean[j, s] = joint[0, j] * runs_in(mixing.filters[0], RUN).x[s]
            for i in range(1, run.count):
                mean[j, s] += joint[i, j] * runs_in(mixing.filters[i], RUN).x[s]
    _mix_covariances(mixing, run, joint, mean)
    for j in range(run.count):
        for s in range(run.s):
            runs_in(mixing.filters[j], RUN).x[s] = mean[j, s]


def _mix_covariances(mixing: Mixing, run: Lanes, joint: View, mean: View) -> None:
    """The states are still those before the mixture."""
    mixed = room(run, "count")
    for s in range(run.s):
        for t in range(s + 1):
            for j in range(run.count):
                total = run.zero
                for i in range(run.count):
                    own = runs_in(mixing.filters[i], RUN)
                    spread = (own.x[s] - mean[j, s]) * (own.x[t] - mean[j, t])
                    total += joint[i, j] * (own.P[s, t] + spread)
                mixed[j] = total
            for j in range(run.count):
                runs_in(mixing.filters[j], RUN).P[s, t] = mixed[j]


# The loop of mixed filters: the steps of a timeline, one after the other.


def run_mixture(
    steps: Steps, scored: TruthRows, mixing: Mixing, rules: Rules, kept: Kept, exchange: Exchange
) -> tuple[int, int]:
    """Run all steps, or up to where the last run is lost; arguments as those of `jerkbench.kinematic.loop.run_steps`.

    The array of ``kept`` holds the combined state, and the sums.

    Returns:
        How many stamps of the reference were visited, and how many updates there were.
    """
    combined = runs_in(kept.w, RUN)
    begin_mixture(mixing, combined)
    reached = updates = 0
    for k in range(len(steps.model)):
        for j in range(combined.count):
            models = mixing.A[j], mixing.b[j], mixing.Q[j]
            move(runs_in(mixing.filters[j], RUN), steps, models, 1 if mixing.triangular else 0, k)
        if steps.update[k] >= 0:
            update_mixture(combined, steps, scored, mixing, rules, kept, exchange, steps.update[k], updates)
            updates += 1
            if all_lost(combined, k):
                return reached, updates
        if steps.reference[k] >= 0:
            combine(mixing, combined)
            keep(combined, scored, kept, steps.reference[k], reached)
            reached += 1
    return reached, updates


def begin_mixture(mixing: Mixing, combined: Lanes) -> None:
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


def update_mixture(
    combined: Lanes,
    steps: Steps,
    scored: TruthRows,
    mixing: Mixing,
    rules: Rules,
    kept: Kept,
    exchange: Exchange,
    which: int,
    place: int,
) -> None:
    """Adapt R by the combined prediction, update and weigh all filters, mix them."""
    combine(mixing, combined)
    nis = expect(combined, steps, rules, kept, exchange, which, place)
    for j in range(combined.count):
        correct_filter(combined, runs_in(mixing.filters[j], RUN), steps, mixing, j, which, exchange.states)
    weigh(mixing)
    mix(mixing, combined, rows_used(combined))
    for j in range(combined.count):
        mirror(runs_in(mixing.filters[j], RUN))
    finish(combined, scored, kept, which, place, nis)


def correct_filter(combined: Lanes, run: Lanes, steps: Steps, mixing: Mixing, j: int, which: int, states: int) -> None:
    """Update filter ``j`` with the rows and the R of the mixture, and put its log likelihood into mu."""
    z = taken(steps.z, which, run, "6")
    for r in range(6):
        for c in range(6):
            run.R[r, c] = combined.R[r, c]
        run.used[r] = combined.used[r]
        run.y[r] = chosen(run.used[r], 0.0, z[r] - run.x[r], 0.0)
    log_likelihood(run, mahalanobis(run), mixing.mu, j)
    correct(run, states)
    check_definite(run)
    combined.lost += run.lost


_OWN = ("run_mixture", "begin_mixture", "move", "log_likelihood", "weigh", "mix", "correct_filter")
"""Kernels that stand alone: one body of all of them takes long to compile."""


class Mixed(NamedTuple):
    """The begin of a mixture of k filters with n states.

    Attributes:
        filters: the k filters.
        transitions: (k, k) Pi.
        weights: (k,) c.
        x: (k, n) mixed states.
        P: (k, n, n) their covariances.
    """

    filters: tuple[Filter, ...]
    transitions: FloatArray
    weights: FloatArray
    x: FloatArray
    P: FloatArray

    @property
    def shape(self) -> tuple[int, int]:
        """Number of filters, and of quantities on each axis."""
        return len(self.filters), self.x.shape[1] // 3


@cache
def mixture_for(n: int, width: int, count: int) -> Any:  # noqa: ANN401 - numba has no types
    """Return the compiled loop of ``width`` runs for ``count`` filters with ``n`` quantities on each axis."""
    constants = {"RUN": run_type(n, width, count=count), "DENSE": 0}
    title = f"{count} mixed filters, {runs_of(width)} of {3 * n} states"
    return compiled_loop(run_mixture, title, constants, APART + _OWN)


def mix_alone(timeline: Timeline, start: Mixed, rule: Rule) -> Estimate:
    """Run with a trajectory; stops at the first sign of divergence."""
    count, n = start.shape
    lengths_s, which = timeline.lengths
    mixing = mixing_of([start], lengths_s, timeline)
    return run_alone(timeline, which, rule, (mixture_for(n, 1, count), run_type(n, 1), mixing))[0]


def mix_many(
    runs: Sequence[Run], starts: Sequence[Mixed], rules: Sequence[Rule], *, updates: bool, threads: int
) -> list[Streamed | None]:
    """Run all ``runs`` side by side without trajectories; None where one stops on the way.

    All are mixtures of as many filters.
    """

    def prepare(pack: Pack, lanes: Sequence[int]) -> tuple[Any, ...]:
        count, n = starts[lanes[0]].shape
        mixing = mixing_of([starts[k] for k in lanes], pack.lengths_s, pack.timelines[0])
        return mixture_for(n, WIDE, count), run_type(n, WIDE), mixing

    sizes = [start.shape[1] for start in starts]
    return run_packs(runs, sizes, rules, prepare, updates=updates, threads=threads)


def mixing_of(starts: Sequence[Mixed], lengths_s: FloatArray, timeline: Timeline) -> Mixing:
    """Return the filters of each run as arrays, and room for them; steps have ``lengths_s``."""
    (count, n), width = starts[0].shape, len(starts)
    models = [model_of([start.filters[j] for start in starts], lengths_s, timeline.dt0_s) for j in range(count)]
    return Mixing(
        _together([model.A for model in models]),
        _together([model.b for model in models]),
        _together([model.Q for model in models]),
        all(model.triangular for model in models),
        np.stack([start.x for start in starts], axis=-1),
        np.stack([start.P.reshape(count, -1) for start in starts], axis=-1),
        np.stack([start.transitions.ravel() for start in starts], axis=-1),
        np.stack([start.weights for start in starts], axis=-1),
        np.zeros((count, width)),
        aligned_zeros(count, -(-run_type(n, width).sizes["length"] // WIDE) * WIDE),
    )


def _together(parts: Sequence[FloatArray]) -> FloatArray:
    """All filters in one array; one that the runs share is repeated where they do not share another."""
    width = max(part.shape[-1] for part in parts)
    return np.stack([np.broadcast_to(part, (*part.shape[:-1], width)) for part in parts])
