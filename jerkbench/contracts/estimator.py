"""The contract of an estimator: any filter that is not a kinematic one."""

from collections.abc import Sequence
from typing import ClassVar, Protocol, Self, runtime_checkable

from jerkbench.contracts.adaptation import Adaptation
from jerkbench.estimate import Attitude, Estimate
from jerkbench.recording import Recording
from jerkbench.streamed_run import RecordedRun, Streamed


@runtime_checkable
class Estimator(Protocol):
    """Anything that is not a kinematic filter; it stands in the group ``filter`` too."""

    adaptations: ClassVar[tuple[str, ...]]
    """Names of the adaptations that it accepts; a sweep leaves the others out."""

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the navigation solution at the reference's stamps."""
        ...


@runtime_checkable
class Batched(Protocol):
    """What an estimator may have as well, so that it is quick: a compiled way, with and without trajectories.

    ``estimate`` stays the definition of right, and what the engine `filterpy` runs; an engine that is `SideBySide`
    takes the compiled way. `jerkbench.testing.check_filter` compares the two. Of both methods None means: not in this
    way, run ``estimate``, which says what is the matter.
    """

    def estimate_compiled(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate | None:
        """Return what ``estimate`` returns."""
        ...

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
        """Run over all ``runs`` without keeping trajectories; what one raises harms no other.

        Args:
            runs: recordings with their attitudes, and what the errors count for.
            estimators: that of each run; they are of one class, and differ in their numbers.
            adaptations: that of each run, likewise.
            updates: whether to keep what the updates saw.
            attitude: whether to keep the attitude, where the estimator finds one of its own.
            threads: how many to use.

        Returns:
            The sums of each run, or None.
        """
        ...


@runtime_checkable
class PerSeed(Protocol):
    """What an estimator may have as well: it is another for each seed, of which a sweep runs each on its own."""

    @property
    def for_each_seed(self) -> bool:
        """Whether it has something for each seed; if not, a cell of several seeds makes no sense."""
        ...

    def of_seed(self, seed: int) -> Estimator:
        """Return the one of ``seed``."""
        ...
