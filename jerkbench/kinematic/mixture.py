"""The compiled IMM estimator of two kinematic filters. `jerkbench.filters.imm` documents the equations."""

import math
from collections.abc import Sequence
from functools import cache, partial
from typing import Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.compiled import Compilation, not_inlined
from jerkbench.compilation.vectors import as_numbers, in_lanes, select
from jerkbench.contracts import Filter
from jerkbench.estimate import Estimate, Streamed
from jerkbench.kinematic.arguments import (
    Called,
    Model,
    Output,
    Rules,
    Runs,
    Scoring,
    Steps,
    loop_type,
    read,
    record_layout,
)
from jerkbench.kinematic.loop import all_stopped, give, note_update, predict
from jerkbench.kinematic.rules import Rule
from jerkbench.kinematic.runs import Pack, Prepared, run_packs, run_trajectory
from jerkbench.kinematic.update import (
    adapt_R,
    check_definite,
    correct,
    expect,
    fill_innovation,
    find_nis,
    note_used,
    rows_used,
)
from jerkbench.timeline import Run, Timeline


def _layout(n: int) -> np.dtype[Any]:
    """Return the `record_layout` with x and P of the combined estimate, and x0, P0, x1 and P1 of the two filters."""
    s = 3 * n
    states = (("x0", (s,)), ("P0", (s, s)), ("x1", (s,)), ("P1", (s, s)))
    weights = (("Pi", (2, 2)), ("c", (2,)), ("mu", (2,)), ("w", (2, 2)), ("deviation", (2, s)))
    return record_layout(n, s, (*states, *weights))


def run_mixture(
    steps: Steps,
    scored: Scoring,
    models: tuple[Model, Model],
    rules: Rules,
    adapt: Called,
    _gain: Called,
    output: Output,
    state: Runs,
) -> None:
    """Process all time steps of eight runs. The loop ends early if all runs have stopped.

    The arguments are the same as in `jerkbench.kinematic.loop.run_steps`, with two models instead of ``model``.
    """
    run = in_lanes(state)
    for k in range(len(steps.model)):
        if steps.model[k] >= 0:
            predict(run, run.x0, run.P0, steps, models[0], k)
            predict(run, run.x1, run.P1, steps, models[1], k)
        which = steps.update[k]
        if which >= 0:
            combine(run)
            fill_innovation(run, steps.z, which)
            expect(run, steps, which)
            if rules.called:
                adapt_R(run, rules, adapt)
            note_used(run, find_nis(run, run.P))
            _correct(run, run.x0, run.P0, steps.z, which, 0)
            _correct(run, run.x1, run.P1, steps.z, which, 1)
            weigh(run)
            mix(run)
            note_update(run, scored.counts, output, which)
            if all_stopped(run, k):
                return
        if steps.reference[k] >= 0:
            combine(run)
            give(run, run.P, scored, output, steps.reference[k])


@not_inlined
def _correct(run: Runs, x: FloatArray, P: FloatArray, z: FloatArray, which: int, j: int) -> None:
    """Update filter ``j`` with the adapted R and the measurement rows that the adaptation has not dropped.

    The log likelihood of the filter, up to a constant, is stored in ``run.mu[j]``.
    """
    read(z, which, run.y)
    for r in range(6):
        run.y[r] = select(run.used[r], 0.0, run.y[r] - x[r], 0.0)
    run.mu[j] = correct(run, x, P)
    D, mu = as_numbers(run.D), as_numbers(run.mu)
    for k in range(8):
        position, velocity = D[0, k] * D[1, k] * D[2, k], D[3, k] * D[4, k] * D[5, k]
        mu[j, k] = -0.5 * (math.log(position) + math.log(velocity) + mu[j, k])
    check_definite(run, x, P)


@not_inlined
def combine(run: Runs) -> None:
    """Compute the mean and the covariance of position and velocity of the mixture of both filters."""
    c0, c1, d, P0, P1 = run.c[0], run.c[1], run.deviation, run.P0, run.P1
    for s in range(6):
        run.x[s] = c0 * run.x0[s] + c1 * run.x1[s]
        d[0, s], d[1, s] = run.x0[s] - run.x[s], run.x1[s] - run.x[s]
    for s in range(6):
        for t in range(s + 1):
            total = c0 * (P0[s, t] + d[0, s] * d[0, t]) + c1 * (P1[s, t] + d[1, s] * d[1, t])
            run.P[s, t] = run.P[t, s] = total


def weigh(run: Runs) -> None:
    """Replace the log likelihoods in mu by mode probabilities. Scaling by the larger likelihood avoids underflow."""
    mu, c = as_numbers(run.mu), as_numbers(run.c)
    for k in range(8):
        largest = max(mu[0, k], mu[1, k])
        first, second = c[0, k] * math.exp(mu[0, k] - largest), c[1, k] * math.exp(mu[1, k] - largest)
        mu[0, k], mu[1, k] = first / (first + second), second / (first + second)


@not_inlined
def mix(run: Runs) -> None:
    """Mix the states and covariances of the two filters in each run in which the update used at least one row."""
    mu, c, Pi, w, deviation, rows = run.mu, run.c, run.Pi, run.w, run.deviation, rows_used(run)
    x0, x1, P0, P1 = run.x0, run.x1, run.P0, run.P1
    for j in range(2):
        total = Pi[0, j] * mu[0] + Pi[1, j] * mu[1]
        c[j] = select(rows, 0.0, total, c[j])
        for i in range(2):
            w[i, j] = select(rows, 0.0, Pi[i, j] * mu[i] / total, 1.0 if i == j else 0.0)
    for s in range(len(x0)):
        first, second = w[0, 0] * x0[s] + w[1, 0] * x1[s], w[0, 1] * x0[s] + w[1, 1] * x1[s]
        deviation[0, s], deviation[1, s] = first, second
    for s in range(len(x0)):
        for t in range(s + 1):
            first = _mixed(w[0, 0], w[1, 0], P0[s, t], P1[s, t], x0, x1, deviation[0], s, t)
            second = _mixed(w[0, 1], w[1, 1], P0[s, t], P1[s, t], x0, x1, deviation[1], s, t)
            P0[s, t] = P0[t, s] = first
            P1[s, t] = P1[t, s] = second
    for s in range(len(x0)):
        x0[s], x1[s] = deviation[0, s], deviation[1, s]


def _mixed(
    w0: float, w1: float, P0: float, P1: float, x0: FloatArray, x1: FloatArray, mean: FloatArray, s: int, t: int
) -> float:
    """Return the mixed covariance of the states s and t, where w0 and w1 are the weights of the two filters."""
    first = w0 * (P0 + (x0[s] - mean[s]) * (x0[t] - mean[t]))
    return first + w1 * (P1 + (x1[s] - mean[s]) * (x1[t] - mean[t]))


Mixed = tuple[tuple[Filter, Filter], FloatArray, FloatArray, FloatArray, FloatArray]
"""The two filters of a run, and their start.

The start consists of the mixed initial states x (2, s), their covariances P (2, s, s), the transition probabilities Pi
(2, 2), and the mode probabilities c (2,) after the first mixing.
"""


@cache
def mixture_for(n: int) -> Compilation:
    """Return the compiled IMM loop for two filters with ``n`` states per axis."""
    title = f"the loop of two mixed filters ({3 * n} states)"
    return Compilation(run_mixture, title, loop_type(_layout(n), tuple[Model, Model]), contract=True)


def mix_single(timeline: Timeline, start: Mixed, rule: Rule) -> Estimate | None:
    """Return the estimate of one IMM run up to a divergence, or None if the adaptation raises an error."""
    return run_trajectory(timeline, rule, partial(_prepared, [start]))[0]


def mix_many(
    runs: Sequence[Run], starts: Sequence[Mixed], rules: Sequence[Rule | None], *, updates: bool, threads: int
) -> list[Streamed | None]:
    """Return the error sums of each IMM run of a batch, or None for a run that the caller must repeat alone."""
    states = [x.shape[1] for _, x, *_ in starts]
    return run_packs(runs, states, rules, partial(_prepared, starts), updates=updates, threads=threads)


def _prepared(starts: Sequence[Mixed], pack: Pack) -> Prepared:
    models = [pack.kinematic([filters[j] for filters, *_ in starts])[0] for j in range(2)]
    x, P, Pi, c = (np.stack(parts, axis=-1) for parts in zip(*(starts[k][1:] for k in pack.lanes), strict=True))
    n = models[0].A.shape[1]
    initial = {"x0": x[0], "x1": x[1], "P0": P[0], "P1": P[1], "Pi": Pi, "c": c}
    return mixture_for(n), _layout(n), (models[0], models[1]), initial
