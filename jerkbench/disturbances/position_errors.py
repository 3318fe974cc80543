"""Fixes that are off and do not say so: outliers, a ladder of spikes, false fixes, and a lever arm."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import nearest_rows
from jerkbench.disturbances.common import (
    FROM_0_TO_1,
    OFFSET,
    DrawnFault,
    Once,
    RegularWindows,
    WindowTimes,
    displaced,
    fixes_of,
    in_each,
    in_plane,
    in_space,
    own_stream,
)
from jerkbench.errors import PluginError, RecordingError
from jerkbench.geometry import dcm_from_euler
from jerkbench.parameters import Limit
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("disturbance", "outliers")
@dataclass(frozen=True)
class Outliers(DrawnFault):
    """Single position fixes that are off by metres; the reported covariance does not change.

    Each fix, with the given probability and independent of the others, is moved by o = d u: d ~ U(smallest, largest),
    u a random direction in space. Of those R_true' = R_true + o o'. A test that drops a fix (chi2) should see them; a
    window over several fixes hardly helps.

    Attributes:
        probability: that a fix is an outlier, from 0 to 1.
        smallest_m: length of o.
        largest_m: length of o.
        size_m: length of every o, to be swept; null: ``smallest_m`` to ``largest_m``.
        start_s: no outlier before (the first fix is where a filter starts).
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    probability: Annotated[float, FROM_0_TO_1] = 0.02
    smallest_m: float = 5.0
    largest_m: float = 20.0
    size_m: Annotated[float | None, OFFSET] = None
    start_s: float = 10.0
    stream: str = ""

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        self.require_range("smallest_m", "largest_m", "m")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the outliers of ``seed``.

        Raises:
            RecordingError: it has no position.
        """
        position = fixes_of(recording, "so none can be an outlier; leave it out.")
        random, m = own_stream(seed, "outliers", self.stream), len(position.t_s)
        hit = (random.uniform(size=m) < self.probability) & (position.t_s >= self.start_s)
        direction, sizes = in_space(random, m), random.uniform(self.smallest_m, self.largest_m, m)
        sizes = sizes if self.size_m is None else np.full(m, self.size_m)
        return replace(recording, position=displaced(position, (sizes * hit)[:, None] * direction))


@register("disturbance", "spike_sweep")
@dataclass(frozen=True)
class SpikeSweep(DrawnFault):
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

    smallest_m: float = 1.0
    largest_m: float = 200.0
    every_s: Annotated[float, Limit(lambda time: time > 0, "give more than 0 s.")] = 10.0
    first_s: float = 20.0
    stream: str = ""

    def __post_init__(self) -> None:
        """Check the ranges."""
        super().__post_init__()
        self.require_range("smallest_m", "largest_m", "m", above=True)

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
        shift = np.zeros((len(position.t_s), 3))
        shift[rows] = sizes_m[:, None] * in_plane(random, len(rows))
        return replace(recording, position=displaced(position, shift))


@register("disturbance", "false_fix")
@dataclass(frozen=True)
class FalseFix(RegularWindows):
    """False fixes in the given windows: off by a constant of a given size, with the covariance of a right one.

    Each window has an offset o of length d in a random direction of space::

        z' = z + o,  R_true' = R_true + o o',  R' = R

    Attributes:
        offset_m: d, length of o; swept, it tells from which size on a fault is noticed.
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    seeded: ClassVar[bool] = True
    fault: ClassVar[str] = "false fix"

    windows_s: WindowTimes = ((30.0, 40.0), (70.0, 80.0), (110.0, 120.0))
    offset_m: Annotated[float, Limit(lambda length: 0 <= length < np.inf, "a length must be 0 m or more.")] = 1.0
    stream: str = ""

    def __post_init__(self) -> None:
        """Check windows and offset."""
        super().__post_init__()
        for window, later in pairwise(sorted(self._windows())):
            if window[1] > later[0]:
                raise PluginError(f"The windows {window} and {later} overlap; give each false fix a window of its own.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the false fixes of ``seed``.

        Raises:
            RecordingError: it has no position.
        """
        position = fixes_of(recording, "so none can be false; leave false_fix out.")
        offsets = in_space(own_stream(seed, "false_fix", self.stream), len(self.windows), self.offset_m)
        return replace(recording, position=displaced(position, in_each(position.t_s, self.windows) @ offsets))


LENGTH = Limit(np.isfinite, "give a finite length, in metres.")


@register("disturbance", "lever_arm")
@dataclass(frozen=True)
class LeverArm(Once):
    """Fixes of an antenna whose lever arm is off: an error that turns with the vehicle and tilts with it.

    With the attitude Omega of the reference at the stamp nearest to the fix, and what is left of the arm l (forward,
    left, up) when the arm as measured has been taken off::

        z' = z + Omega l,  R_true' = R_true + o o' with o = Omega l,  R' = R

    A velocity is that of wheels; it stays as it is, and so does a fix where the reference knows no attitude.

    Attributes:
        forward_m: l, forward.
        left_m: l, to the left.
        up_m: l, upwards.
    """

    forward_m: Annotated[float, LENGTH] = 0.1
    left_m: Annotated[float, LENGTH] = 0.05
    up_m: Annotated[float, LENGTH] = 0.1

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the antenna moved.

        Raises:
            RecordingError: it has no position, or its reference knows no attitude.
        """
        position = fixes_of(recording, "so no antenna can be moved; leave lever_arm out.")
        euler = recording.reference.euler_rad
        if euler is None or not len(euler):
            reason = "has no attitude in its reference, which lever_arm turns the arm with."
            raise RecordingError(f"{recording.name} {reason}")
        at_fixes = euler[nearest_rows(recording.reference.t_s, position.t_s)]
        known = np.isfinite(at_fixes).all(axis=1, keepdims=True)
        arm = np.array([self.forward_m, self.left_m, self.up_m])
        offset = np.where(known, dcm_from_euler(np.where(known, at_fixes, 0.0)) @ arm, 0.0)
        return replace(recording, position=displaced(position, offset))
