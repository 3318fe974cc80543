"""The contract of an adaptation: a rule on R."""

from typing import ClassVar, Protocol, Self, runtime_checkable

from jerkbench.arrays import FloatArray, IntArray


class Adaptation(Protocol):
    """A rule that changes R between predict and update.

    Optional: `Remembering`, `Fading`, `Clocked`, `TrueCovariance`; to change more than R, `AdaptingPrior` and
    `AdaptingGain`.
    """

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the R to use.

        Args:
            innovation: (m,) y = z - H x of the rows that are there.
            HPHt: (m, m) H P- H'.
            R: (m, m) as reported, diagonal not below the floor.
            rows: (m,) which of the six rows these are (0-2 position, 3-5 velocity).
            memory: (``memory_size()``,) float64, zero at the start of a run; only this may be changed in place.

        Returns:
            (m, m). An infinite variance drops its row; with all dropped there is no update.
        """
        ...


@runtime_checkable
class Remembering(Protocol):
    """An adaptation that remembers something from one update to the next."""

    def memory_size(self) -> int:
        """Return the length of the memory that `adapt` gets; without this method there is none."""
        ...


@runtime_checkable
class RememberingStates(Protocol):
    """An adaptation whose memory depends on how many states the filter has; in place of `Remembering`."""

    def memory_size_of(self, states: int) -> int:
        """Return the length of the memory over a filter of ``states`` states."""
        ...


@runtime_checkable
class Clocked(Protocol):
    """An adaptation with a parameter in seconds: before a run it hears when the updates are, and may count them."""

    def at_updates(self, since_start_s: FloatArray) -> Self:
        """Return the adaptation for a run whose updates are at these times (m,), seconds since its start."""
        ...


@runtime_checkable
class TrueCovariance(Protocol):
    """An adaptation that gets the true covariance as R, if the attribute is True: an oracle."""

    wants_true_covariance: ClassVar[bool]
