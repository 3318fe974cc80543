"""Multipath: fixes that are off on one axis for some seconds, and do not say so."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import PluginError, RecordingError
from jerkbench.plugins import register
from jerkbench.recording import Position, Recording
from jerkbench.streams import stream


@register("disturbance", "multipath_single_axis")
@dataclass(frozen=True)
class MultipathSingleAxis:
    """Bursts in which the position is off by a constant on one axis; the reported covariance does not change.

    A burst begins at random, lasts T ~ U(shortest, longest), and moves all its fixes by s d e_i with the axis i of
    east, north, up, the sign s and d ~ U(smallest, largest) at random. Bursts do not overlap. Where a burst is, the
    true covariance is::

        R_true = R + d^2 e_i e_i'

    Attributes:
        bursts: how many in a run.
        shortest_s: of a burst.
        longest_s: of a burst.
        smallest_m: offset.
        largest_m: offset.
        start_s: no burst before.
    """

    seeded: ClassVar[bool] = True

    bursts: int = 10
    shortest_s: float = 2.0
    longest_s: float = 6.0
    smallest_m: float = 0.5
    largest_m: float = 2.0
    start_s: float = 10.0

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

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the bursts of ``seed``.

        Raises:
            RecordingError: it has no position, or is too short for so many bursts.
        """
        if recording.position is None:
            raise RecordingError(f"{recording.name} has no position fixes, so there is nothing for multipath to move.")
        random = stream(seed, "disturbance", "multipath_single_axis")
        windows_s = self._windows(random, recording)
        offsets_m = self._offsets(random)
        return replace(recording, position=_moved(recording.position, windows_s, offsets_m))

    def replicates(self) -> int:
        """Return 1."""
        return 1

    def _windows(self, random: np.random.Generator, recording: Recording) -> FloatArray:
        """Return (bursts, 2): the time that is left over is cut at random points into the gaps between the bursts."""
        lengths = random.uniform(self.shortest_s, self.longest_s, self.bursts)
        cuts = np.sort(random.uniform(size=self.bursts))
        left_s = recording.duration_s - self.start_s - lengths.sum()
        if left_s < 0:
            raise RecordingError(
                f"{recording.name} lasts {recording.duration_s:.1f} s; {self.bursts} bursts of {lengths.sum():.1f} s"
                f" together do not fit after {self.start_s} s: ask for fewer or shorter ones."
            )
        begins = self.start_s + cuts * left_s + np.cumsum(lengths) - lengths
        return np.column_stack([begins, begins + lengths])

    def _offsets(self, random: np.random.Generator) -> FloatArray:
        """Return (bursts, 3) ENU, one axis each."""
        sizes = random.uniform(self.smallest_m, self.largest_m, self.bursts) * random.choice([-1.0, 1.0], self.bursts)
        return np.asarray(np.eye(3)[random.integers(3, size=self.bursts)] * sizes[:, None])


def _moved(position: Position, windows_s: FloatArray, offsets_m: FloatArray) -> Position:
    inside = (position.t_s[:, None] >= windows_s[:, 0]) & (position.t_s[:, None] < windows_s[:, 1])
    shift = inside @ offsets_m
    true = position.covariance_m2 if position.true_covariance_m2 is None else position.true_covariance_m2
    return replace(
        position, enu_m=position.enu_m + shift, true_covariance_m2=true + shift[:, :, None] * shift[:, None, :]
    )
