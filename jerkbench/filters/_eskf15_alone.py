"""Error-state filters with the parts and parameters of eskf15, without a compiled way."""

from collections.abc import Sequence
from dataclasses import dataclass

from jerkbench.contracts import Adaptation
from jerkbench.estimate import Attitude, Estimate
from jerkbench.filters.eskf15 import Eskf15
from jerkbench.recording import Recording
from jerkbench.sums import RecordedRun, Streamed


@dataclass(frozen=True)
class Eskf15Alone(Eskf15):
    """A base of estimators that run in NumPy with either engine."""

    def estimate_compiled(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate | None:
        """Return None: there is no compiled way."""

    def run_settings(
        self,
        runs: Sequence[RecordedRun],
        estimators: Sequence[Eskf15],
        adaptations: Sequence[Adaptation],
        *,
        updates: bool,
        attitude: bool,
        threads: int,
    ) -> Sequence[Streamed | None]:
        """Return None for each run: there is no compiled way."""
        return [None] * len(runs)
