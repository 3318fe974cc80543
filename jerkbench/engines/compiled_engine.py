"""The fast engine: the same filter, compiled. The kernel itself, fading and all, is in `jerkbench/kinematic/`."""

import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING

from jerkbench.compilation.module_cache import LOOPS, can_compile
from jerkbench.contracts import (
    Adaptation,
    AdaptingGain,
    AdaptingPrior,
    Estimator,
    Filter,
    asked_in_lanes,
    changes_nothing,
    clocked,
    has_methods,
)
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.estimate import Estimate, Streamed
from jerkbench.notices import notify
from jerkbench.plugins import register
from jerkbench.timeline import Run, Timeline

if TYPE_CHECKING:
    from jerkbench.kinematic.plugin_call import Rule  # what it imports takes half a second


@register("engine", "compiled")
@dataclass(frozen=True)
class CompiledEngine:
    """Runs any filter with any adaptation compiled by numba; benchmarks/engines.py prints how much faster it is.

    The same equations as the engine `filterpy`, arranged for speed::

        F P F' for all pairs of axes at once, F = A (x) I3;   S = H P H' + R = L D L',   Y = L^-1 H P,   w = L^-1 y
        x = x + Y' D^-1 w,   P = P - Y' D^-1 Y;   and of measured states with R < P: x + y - R S^-1 y,   R - R S^-1 R

    The plugin's own methods are compiled as they are. What is compiled is kept on disk ($JERKBENCH_CACHE, or
    the user's cache folder): the first run of a new plugin takes some seconds, later processes start at once, and
    an edit of the plugin, or of a helper that it calls, is noticed. An adaptation that numba cannot compile runs on
    the engine `filterpy`; one line says why.

    Both engines agree to 1e-9 m and to 1e-12 of sqrt(P_ii P_jj), unless the run itself amplifies rounding (a fade by
    a thousand, a weight that falls to nothing): then as far as the reference agrees with itself when its measurements
    change in their last bits.
    """

    def run(self, timeline: Timeline, model: Filter, adaptation: Adaptation) -> Estimate:
        """Run ``model`` with ``adaptation`` over ``timeline``; stops at the first sign of divergence."""
        compiled = _compiled_rule(clocked(adaptation, timeline))
        if compiled is None:
            return FilterpyEngine().run(timeline, model, adaptation)
        from jerkbench.kinematic.runs import run_single

        return run_single(timeline, model, compiled)

    def prepare(self, model: Filter) -> None:
        """Begin to compile what `run` will need, beside what this process does until then."""
        from jerkbench.kinematic.loop import compile_beside

        if can_compile():
            compile_beside(2 + len(model.initial_variances()))

    def announce(self, methods: Sequence[tuple[Filter | Estimator, Adaptation]]) -> None:
        """Note the loops that a sweep needs in the environment of the processes that start afterwards.

        A process that needs a loop while another one is compiling it compiles one of the others in the meantime.
        """
        loops = set()
        for model, own in methods:
            with suppress(Exception):  # of a plugin: the run raises it again, and it becomes a failed row
                if isinstance(model, Filter):
                    at_once = asked_in_lanes(own) or changes_nothing(own)
                    loops.add(f"{2 + len(model.initial_variances())} {_sees_matrices(own):d} {at_once:d}")
        os.environ[LOOPS] = ",".join(sorted(loops))

    def run_settings(
        self,
        runs: Sequence[Run],
        models: Sequence[Filter],
        adaptations: Sequence[Adaptation],
        *,
        updates: bool,
        threads: int,
    ) -> Sequence[Streamed | None]:
        """Run all ``runs`` side by side, each with its own of ``models`` and ``adaptations``, without trajectories.

        Returns:
            The sums of each run; None where it is to be run alone by `run`, which says why.
        """
        from jerkbench.kinematic.runs import run_batch

        owned = [clocked(own, run.timeline) for own, run in zip(adaptations, runs, strict=True)]
        known = {
            own: _compiled_rule(own, side_by_side=True) for own in dict.fromkeys(owned)
        }  # equal ones are one, asked for once
        results: list[Streamed | None] = [None] * len(runs)
        rules = {k: rule for k, own in enumerate(owned) if (rule := known[own]) is not None}
        batch = [runs[k] for k in rules], [models[k] for k in rules], list(rules.values())
        for k, result in zip(rules, run_batch(*batch, updates=updates, threads=threads), strict=True):
            results[k] = result
        return results


def _sees_matrices(adaptation: Adaptation) -> bool:
    return has_methods(adaptation, AdaptingPrior) or has_methods(adaptation, AdaptingGain)


def _compiled_rule(adaptation: Adaptation, *, side_by_side: bool = False) -> "Rule | None":
    """The compiled adaptation, or None, with one line that says why numba cannot compile it."""
    if not can_compile():
        notify("runs go on the engine filterpy, because NUMBA_DISABLE_JIT is set: numba compiles nothing")
        return None
    from jerkbench.kinematic.plugin_call import compiled_rule

    return compiled_rule(adaptation, "{} runs on the engine filterpy", side_by_side=side_by_side)
