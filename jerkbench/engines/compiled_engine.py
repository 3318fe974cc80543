"""The engine `compiled`, which runs kinematic filters in compiled code. The kernel is in `jerkbench/kinematic/`."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from jerkbench.compilation.compiled import can_compile
from jerkbench.contracts import Adaptation, Filter, clocked
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.errors import notify
from jerkbench.estimate import Estimate, Streamed
from jerkbench.plugins import register
from jerkbench.timeline import Run, Timeline

if TYPE_CHECKING:
    from jerkbench.kinematic.rules import Rule  # importing this module takes half a second


@register("engine", "compiled")
@dataclass(frozen=True)
class CompiledEngine:
    """Runs any filter with any adaptation in code that numba compiles; benchmarks/engines.py measures the speed.

    The equations are equivalent to the equations of the engine `filterpy`, but are arranged for speed::

        F P F' for all pairs of axes at once, F = A (x) I3;   S = H P H' + R = L D L',   Y = L^-1 H P,   w = L^-1 y
        x = x + Y' D^-1 w,   P = P - Y' D^-1 Y;   and of measured states with R < P: x + y - R S^-1 y,   R - R S^-1 R

    numba compiles the unchanged methods of the plugin. The compiled code is cached on disk, in $JERKBENCH_CACHE or in
    the cache folder of the user. The first run of a new plugin takes a few seconds longer, and later processes use the
    cached code. After a change of the plugin, or of a function that the plugin calls, the plugin is compiled again. If
    numba cannot compile an adaptation, the engine `filterpy` runs the adaptation, and a message states the reason.

    The states of both engines agree to 1e-9 m, and the covariances agree to 1e-12 of sqrt(P_ii P_jj). The differences
    are larger if the run amplifies rounding errors, for example with a fading factor of 1000 or a weight close to zero.
    In such a run, the engines differ as much as two runs of the engine `filterpy` whose measurements differ in the last
    bits.
    """

    def run(self, timeline: Timeline, model: Filter, adaptation: Adaptation) -> Estimate:
        """Run the filter ``model`` with ``adaptation`` over ``timeline``. The estimate ends if the filter diverges.

        If the adaptation raises an error, the run is repeated with the engine `filterpy`, which raises the error again.
        """
        rule = _compiled_rule(clocked(adaptation, timeline))
        if rule is not None:
            from jerkbench.kinematic.runs import run_single

            if (estimate := run_single(timeline, model, rule)) is not None:
                return estimate
        return FilterpyEngine().run(timeline, model, adaptation)

    def run_settings(
        self,
        runs: Sequence[Run],
        models: Sequence[Filter],
        adaptations: Sequence[Adaptation],
        *,
        updates: bool,
        threads: int,
    ) -> Sequence[Streamed | None]:
        """Run a batch of runs without storing trajectories. Run k uses the filter ``models[k]`` and ``adaptations[k]``.

        Returns:
            The error sums of each run, or None for each run that the method `run` must repeat to find the reason of a
            failure.
        """
        from jerkbench.kinematic.runs import compile_ahead, run_batch

        clocks = [clocked(one, run.timeline) for one, run in zip(adaptations, runs, strict=True)]
        if can_compile():
            compile_ahead(models, clocks)
        compiled = {one: _compiled_rule(one) for one in dict.fromkeys(clocks)}  # compile equal adaptations only once
        return run_batch(runs, models, [compiled[one] for one in clocks], updates=updates, threads=threads)


def _compiled_rule(adaptation: Adaptation) -> "Rule | None":
    """Return the compiled adaptation. If numba cannot compile the adaptation, print the reason and return None."""
    if not can_compile():
        notify("runs use the engine filterpy, because NUMBA_DISABLE_JIT is set and numba therefore compiles nothing")
        return None
    from jerkbench.kinematic.rules import compiled_rule

    return compiled_rule(adaptation, "{} runs on the engine filterpy")
