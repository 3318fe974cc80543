"""The contract of an engine."""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from jerkbench.contracts.adaptation import Adaptation
from jerkbench.contracts.filter import Filter
from jerkbench.estimate import Estimate
from jerkbench.streamed_run import Run, Streamed
from jerkbench.timeline.timeline import Timeline


class Engine(Protocol):
    """A way to run a kinematic filter with an adaptation; all engines have the same inputs and outputs.

    Optional: `SideBySide`, `Preparing`; `jerkbench.engines.compiled_engine` has both.
    """

    def run(self, timeline: Timeline, model: Filter, adaptation: Adaptation) -> Estimate:
        """Return the navigation solution at the reference's stamps."""
        ...


@runtime_checkable
class SideBySide(Protocol):
    """An engine that runs many timelines at once, without keeping trajectories; what one raises harms no other."""

    def run_settings(
        self,
        runs: Sequence[Run],
        models: Sequence[Filter],
        adaptations: Sequence[Adaptation],
        *,
        updates: bool,
        threads: int,
    ) -> Sequence[Streamed | None]:
        """Return the sums of each run; None where it is to be run alone by `Engine.run`, which says why.

        Args:
            runs: timelines, and what the errors count for.
            models: the filter of each run.
            adaptations: the adaptation of each run.
            updates: whether to keep what the updates saw.
            threads: how many to use.
        """
        ...


@runtime_checkable
class Preparing(Protocol):
    """An engine that can begin with what `Engine.run` will need, while a single run does something else."""

    def prepare(self, model: Filter) -> None:
        """Begin with it."""
        ...
