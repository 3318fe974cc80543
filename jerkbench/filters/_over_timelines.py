"""The compiled way of an estimator that needs a timeline alone."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Self

from jerkbench.contracts import Adaptation
from jerkbench.estimate import Attitude, Estimate
from jerkbench.optional import clocked
from jerkbench.recording import Recording
from jerkbench.sums import RecordedRun, Run, Streamed
from jerkbench.timeline import Timeline, kept_timeline

if TYPE_CHECKING:
    from jerkbench.kinematic.plugin_call import Rule  # what it imports takes half a second


class OverTimelines:
    """An estimator over kinematic filters: `jerkbench.contracts.Batched`."""

    def estimate_compiled(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate | None:
        """Return what ``estimate`` does; None where numba cannot compile the adaptation, or the run stops."""
        from jerkbench.kinematic.plugin_call import compiled_rule

        timeline = kept_timeline(recording, attitude)
        rule = compiled_rule(clocked(adaptation, timeline))
        return None if rule is None else self._alone(timeline, rule)

    def run_settings(
        self,
        runs: Sequence[RecordedRun],
        estimators: Sequence[Self],
        adaptations: Sequence[Adaptation],
        *,
        updates: bool,
        attitude: bool,
        threads: int,
    ) -> Sequence[Streamed | None]:
        """Return the sums of each run, with its own of ``estimators`` and ``adaptations``; it finds no attitude."""
        from jerkbench.kinematic.plugin_call import compiled_rule

        results: list[Streamed | None] = [None] * len(runs)
        every = enumerate(zip(adaptations, runs, strict=True))
        rules = {k: rule for k, (a, run) in every if (rule := compiled_rule(clocked(a, run.timeline))) is not None}
        compiled_runs = [Run(runs[k].timeline, runs[k].scoring) for k in rules]
        own = [estimators[k] for k in rules], list(rules.values())
        for k, result in zip(rules, self._together(compiled_runs, *own, updates=updates, threads=threads), strict=True):
            results[k] = result
        return results

    def _alone(self, timeline: Timeline, rule: "Rule") -> Estimate | None:
        """One run with its trajectory."""
        raise NotImplementedError

    def _together(
        self,
        runs: Sequence[Run],
        estimators: Sequence[Self],
        rules: "Sequence[Rule]",
        *,
        updates: bool,
        threads: int,
    ) -> Sequence[Streamed | None]:
        """All runs without trajectories."""
        raise NotImplementedError
