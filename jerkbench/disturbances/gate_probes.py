"""Faults that probe a gate: single fixes that are off by a ladder of sizes, and false fixes after an outage."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances.common import (
    Once,
    OutageWindows,
    fixes_of,
    own_stream,
    squares,
    with_errors,
    without,
)
from jerkbench.errors import PluginError
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("disturbance", "spike_sweep")
@dataclass(frozen=True)
class SpikeSweep(Once):
    """Single fixes that are displaced horizontally, each by another size; the reported covariance does not change.

    The spike k = 0, 1, ... is the first fix at or after first_s + k every_s, n of them in the recording. Their lengths
    are a ladder, put into a random order; u_k is a random direction east and north::

        |o_k| = smallest_m (largest_m/smallest_m)^(j/(n - 1)),   j = 0 ... n - 1
        z' = z + |o_k| u_k,  R_true' = R_true + o o',  R' = R

    The metric `gate` says which of them the filter took.

    Attributes:
        smallest_m: length of the smallest spike.
        largest_m: length of the largest.
        every_s: from one spike to the next; the filter has to have recovered by then.
        first_s: time of the first.
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    seeded: ClassVar[bool] = True

    smallest_m: float = 1.0
    largest_m: float = 200.0
    every_s: float = 10.0
    first_s: float = 20.0
    stream: str = ""

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0 < self.smallest_m <= self.largest_m < np.inf:
            raise PluginError(f"{self.smallest_m} to {self.largest_m} m is no range; give 0 < smallest <= largest.")
        if not self.every_s > 0:
            raise PluginError(f"every_s is {self.every_s}; give more than 0 s.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the spikes of ``seed``.

        Raises:
            RecordingError: it has no position.
        """
        position = fixes_of(recording, "so none can be a spike; leave spike_sweep out.")
        due_s = np.arange(self.first_s, position.t_s[-1], self.every_s)
        rows = np.unique(np.searchsorted(position.t_s, due_s))
        random = own_stream(seed, "spike_sweep", self.stream)
        sizes_m = random.permutation(np.geomspace(self.smallest_m, self.largest_m, len(rows)))
        angle = random.uniform(0, 2 * np.pi, len(rows))
        shift = np.zeros((len(position.t_s), 3))
        shift[rows, :2] = sizes_m[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        return replace(recording, position=with_errors(position, shift, squares(shift)))


@register("disturbance", "false_return")
@dataclass(frozen=True)
class FalseReturn(OutageWindows):
    """Outages of GNSS after which the fixes come back in a wrong place, agree with each other, and then are right.

    Each window is an outage of position and velocity. For ``false_s`` after its end there is no velocity, and the fixes
    are off by one horizontal offset o of length d in a random direction; their reported covariance does not change::

        z' = z + o,  R_true' = R_true + o o',  R' = R

    Then all is as it was. A filter follows the false fixes, rejects all fixes from then on, or comes back: the metric
    `capture` says which.

    Attributes:
        offset_m: d.
        false_s: how long the false fixes come.
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    seeded: ClassVar[bool] = True

    windows_s: tuple[tuple[float, float], ...] = ((40.0, 50.0),)
    offset_m: float = 50.0
    false_s: float = 20.0
    stream: str = ""

    def __post_init__(self) -> None:
        """Check windows and offset."""
        super().__post_init__()
        if not (0 < self.offset_m < np.inf and self.false_s > 0):
            raise PluginError(f"offset_m is {self.offset_m} and false_s {self.false_s}; give more than 0 of both.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the outages and the false fixes of ``seed``.

        Raises:
            RecordingError: it has no position.
        """
        position = fixes_of(recording, "so none can be false; leave false_return out.")
        windows_s = self.windows_in(recording)
        false_s = np.column_stack([windows_s[:, 1], windows_s[:, 1] + self.false_s])
        inside = (position.t_s[:, None] >= false_s[:, 0]) & (position.t_s[:, None] < false_s[:, 1])
        shift = inside @ self._offsets(len(windows_s), seed)
        velocity = recording.velocity
        if velocity is not None and velocity.frame != "speed":
            velocity = without(velocity, np.concatenate([windows_s, false_s]))
        moved = with_errors(position, shift, squares(shift))
        return replace(
            recording,
            position=without(moved, windows_s),
            velocity=velocity,
            outages_s=np.concatenate([recording.outages_s, windows_s]),
        )

    def _offsets(self, windows: int, seed: int) -> FloatArray:
        """Return (windows, 3) ENU."""
        angle = own_stream(seed, "false_return", self.stream).uniform(0, 2 * np.pi, windows)
        return self.offset_m * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
