"""Several kinematic filters mixed at each update; `jerkbench.filters._mixture` has the equations.

From Python: timelines in, an estimate with its trajectory or sums out. The compiled loop is in `mixing`.
"""

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.compilation.compiled_loop import compiled_loop
from jerkbench.compilation.vectors import WIDE, aligned_zeros
from jerkbench.contracts import Filter
from jerkbench.estimate import Estimate
from jerkbench.kinematic.arguments import run_type
from jerkbench.kinematic.loop import APART, runs_of
from jerkbench.kinematic.packs import Pack, model_of
from jerkbench.kinematic.plugin_call import Rule
from jerkbench.kinematic.runs import run_alone, run_packs
from jerkbench.linear.mixing import Mixing, run_mixture
from jerkbench.sums import Run, Streamed
from jerkbench.timeline import Timeline, step_lengths

OWN = ("run_mixture", "begin_mixture", "move", "combine", "log_likelihood", "weigh", "mix", "correct_filter")
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
    return compiled_loop(run_mixture, title, constants, APART + OWN)


def mix_alone(timeline: Timeline, start: Mixed, rule: Rule) -> Estimate:
    """Run with a trajectory; stops at the first sign of divergence."""
    count, n = start.shape
    lengths_s, which = step_lengths(timeline.dt_s)
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
