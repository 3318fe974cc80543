"""The contract of a disturbance."""

from collections.abc import Hashable
from typing import ClassVar, Protocol

from jerkbench.recording import Recording


class Disturbance(Hashable, Protocol):
    """A change of a recording; optional: `ReadingFile`.

    Attributes:
        seeded: whether it draws random numbers.
    """

    seeded: ClassVar[bool]

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the disturbed recording. Random numbers come from `jerkbench.random_streams.stream` alone."""
        ...

    def replicates(self) -> int:
        """Return how many different results seeds 0, 1, 2, ... give without any randomness (phases of a decimation)."""
        ...
