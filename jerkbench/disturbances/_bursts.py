"""Bursts of multipath, in which the position is off by a constant."""

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances._added_errors import squares, with_errors
from jerkbench.disturbances._draws import own_stream
from jerkbench.errors import PluginError, RecordingError
from jerkbench.recording import Recording


@dataclass(frozen=True)
class Bursts:
    """When the bursts are, and how large.

    A burst begins at random and lasts T ~ U(shortest, longest); an offset is d ~ U(smallest, largest) with a random
    sign. Bursts do not overlap. With o the offset (east, north, up) of a burst, the true covariance of its fixes is::

        R_true = R + o o'

    Attributes:
        bursts: how many in a run.
        shortest_s: of a burst.
        longest_s: of a burst.
        smallest_m: offset.
        largest_m: offset.
        start_s: no burst before.
        size_m: of every offset, to be swept; null: ``smallest_m`` to ``largest_m``.
        length_s: of every burst, to be swept; null: ``shortest_s`` to ``longest_s``.
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    seeded: ClassVar[bool] = True
    stream_name: ClassVar[str]

    bursts: int = 10
    shortest_s: float = 2.0
    longest_s: float = 6.0
    smallest_m: float = 0.5
    largest_m: float = 2.0
    start_s: float = 10.0
    size_m: float | None = None
    length_s: float | None = None
    stream: str = ""

    def __post_init__(self) -> None:
        """Check the ranges."""
        if self.bursts < 0:
            raise PluginError(f"bursts is {self.bursts}; give 0 or more.")
        if not 0 < self.shortest_s <= self.longest_s:
            raise PluginError(
                f"A burst of {self.shortest_s} to {self.longest_s} s is none; give 0 < shortest <= longest."
            )
        if not 0 <= self.smallest_m <= self.largest_m:
            raise PluginError(f"{self.smallest_m} to {self.largest_m} m is no range; give 0 <= smallest <= largest.")

        if self.size_m is not None and not 0 <= self.size_m < np.inf:
            raise PluginError(f"size_m is {self.size_m}; give 0 m or more, or null.")
        if self.length_s is not None and not 0 < self.length_s < np.inf:
            raise PluginError(f"length_s is {self.length_s}; a burst must be longer than 0 s, or null.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the bursts of ``seed``.

        Raises:
            RecordingError: it has no position, or is too short for so many bursts.
        """
        position = recording.position
        if position is None:
            raise RecordingError(f"{recording.name} has no position fixes, so there is nothing for multipath to move.")
        random = own_stream(seed, self.stream_name, self.stream)
        begin, end = self._windows(random, recording).T
        inside = (position.t_s[:, None] >= begin) & (position.t_s[:, None] < end)
        shift = inside @ self._offsets(random)
        return replace(recording, position=with_errors(position, shift, squares(shift)))

    def replicates(self) -> int:
        """Return 1."""
        return 1

    def _windows(self, random: np.random.Generator, recording: Recording) -> FloatArray:
        """Return (bursts, 2): the time that is left over is cut at random points into the gaps between the bursts."""
        lengths = random.uniform(self.shortest_s, self.longest_s, self.bursts)
        if self.length_s is not None:
            lengths = np.full(self.bursts, self.length_s)
        cuts = np.sort(random.uniform(size=self.bursts))
        left_s = recording.duration_s - self.start_s - lengths.sum()
        if left_s < 0:
            raise RecordingError(
                f"{recording.name} lasts {recording.duration_s:.1f} s; {self.bursts} bursts of {lengths.sum():.1f} s"
                f" together do not fit after {self.start_s} s: ask for fewer or shorter ones."
            )
        begins = self.start_s + cuts * left_s + np.cumsum(lengths) - lengths
        return np.column_stack([begins, begins + lengths])

    def _sizes(self, random: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
        """Return offsets with their signs."""
        sizes = random.uniform(self.smallest_m, self.largest_m, shape)
        if self.size_m is not None:
            sizes = np.full(shape, self.size_m)
        return np.asarray(sizes * random.choice([-1.0, 1.0], shape))

    @abstractmethod
    def _offsets(self, random: np.random.Generator) -> FloatArray:
        """Return (bursts, 3) ENU."""
