"""Disturbances with position errors that the reported covariance omits: outliers, false fixes, and a lever arm."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import nearest_rows
from jerkbench.disturbances.common import (
    FROM_0_TO_1,
    OFFSET,
    DrawnFault,
    RegularWindows,
    Unphased,
    WindowTimes,
    displaced,
    fault_stream,
    fixes_of,
    in_each,
    in_plane,
    in_space,
)
from jerkbench.errors import PluginError, RecordingError
from jerkbench.geometry import dcm_from_euler
from jerkbench.parameters import NOT_NEGATIVE, Limit
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("disturbance", "outliers")
@dataclass(frozen=True)
class Outliers(DrawnFault):
    """Adds outliers of metres to single position fixes, without a change of the reported covariance.

    Each fix is an outlier with the given probability, independently of the other fixes. The offset of an outlier is o =
    d u, where d is uniformly distributed between ``smallest_m`` and ``largest_m``, and u is a random direction in
    space::

        z' = z + o,  R_true' = R_true + o o',  R' = R

    A test of the innovation of each fix (adaptation `chi2`) should detect outliers. A window over several fixes hardly
    improves the detection of single outliers.

    Attributes:
        probability: probability that a fix is an outlier, from 0 to 1 [-].
        smallest_m: minimum length of the offset o [m].
        largest_m: maximum length of the offset o [m].
        size_m: common length of all offsets, for parameter sweeps; if null, the lengths are random [m].
        start_s: earliest time of an outlier [s]. An outlier in the first fix would disturb the start of the filter.
        stream: label of the random stream; disturbances of the same type need different labels to be independent.
    """

    probability: Annotated[float, FROM_0_TO_1] = 0.02
    smallest_m: float = 5.0
    largest_m: float = 20.0
    size_m: Annotated[float | None, OFFSET] = None
    start_s: float = 10.0
    stream: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require_range("smallest_m", "largest_m", "m")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with random outliers, generated with ``seed``.

        Raises:
            RecordingError: the recording has no position fixes.
        """
        position = fixes_of(recording, "so outliers cannot be applied; remove outliers.")
        random, m = fault_stream(seed, "outliers", self.stream), len(position.t_s)
        hit = (random.uniform(size=m) < self.probability) & (position.t_s >= self.start_s)
        direction, sizes = in_space(random, m), random.uniform(self.smallest_m, self.largest_m, m)
        sizes = sizes if self.size_m is None else np.full(m, self.size_m)
        return replace(recording, position=displaced(position, (sizes * hit)[:, None] * direction))


@register("disturbance", "spike_sweep")
@dataclass(frozen=True)
class SpikeSweep(DrawnFault):
    """Adds horizontal offsets of different sizes to single fixes, without a change of the reported covariance.

    Spike k = 0, 1, ... affects the first fix at or after first_s + k every_s. The n spikes of a recording have
    geometrically spaced lengths in a random order j(k), and each spike has a random horizontal direction u_k::

        |o_k| = smallest_m (largest_m/smallest_m)^(j/(n - 1)),   j = 0 ... n - 1
        z' = z + |o_k| u_k,  R_true' = R_true + o o',  R' = R

    Attributes:
        smallest_m: length of the smallest spike [m].
        largest_m: length of the largest spike [m].
        every_s: time between two spikes; the filter must recover within this time [s].
        first_s: time of the first spike [s].
        stream: label of the random stream; disturbances of the same type need different labels to be independent.
    """

    smallest_m: float = 1.0
    largest_m: float = 200.0
    every_s: Annotated[float, Limit(lambda time: time > 0, "give more than 0 s.")] = 10.0
    first_s: float = 20.0
    stream: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        self.require_range("smallest_m", "largest_m", "m", above=True)

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with spikes; ``seed`` determines their order and directions.

        Raises:
            RecordingError: the recording has no position fixes.
        """
        position = fixes_of(recording, "so spike_sweep cannot be applied; remove spike_sweep.")
        due_s = np.arange(self.first_s, position.t_s[-1], self.every_s)
        rows = np.unique(np.searchsorted(position.t_s, due_s))
        random = fault_stream(seed, "spike_sweep", self.stream)
        sizes_m = random.permutation(np.geomspace(self.smallest_m, self.largest_m, len(rows)))
        shift = np.zeros((len(position.t_s), 3))
        shift[rows] = sizes_m[:, None] * in_plane(random, len(rows))
        return replace(recording, position=displaced(position, shift))


@register("disturbance", "false_fix")
@dataclass(frozen=True)
class FalseFix(RegularWindows):
    """Adds a constant offset to the fixes in each window, without a change of the reported covariance.

    All fixes in a window have the same offset o of length d in a random direction in space::

        z' = z + o,  R_true' = R_true + o o',  R' = R

    Attributes:
        offset_m: d, length of the offset o [m]. A sweep shows the smallest offset that a filter detects.
        stream: label of the random stream; disturbances of the same type need different labels to be independent.
    """

    seeded: ClassVar[bool] = True
    fault: ClassVar[str] = "false fix"

    windows_s: WindowTimes = ((30.0, 40.0), (70.0, 80.0), (110.0, 120.0))
    offset_m: Annotated[float, NOT_NEGATIVE] = 1.0
    stream: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        for window, later in pairwise(sorted(self._windows())):
            if window[1] > later[0]:
                raise PluginError(
                    f"The windows {window} and {later} overlap; the windows of false fixes must not overlap."
                )

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with false fixes; ``seed`` determines the directions of the offsets.

        Raises:
            RecordingError: the recording has no position fixes.
        """
        position = fixes_of(recording, "so false_fix cannot be applied; remove false_fix.")
        offsets = in_space(fault_stream(seed, "false_fix", self.stream), len(self.windows), self.offset_m)
        return replace(recording, position=displaced(position, in_each(position.t_s, self.windows) @ offsets))


LENGTH = Limit(np.isfinite, "give a finite length, in metres.")


@register("disturbance", "lever_arm")
@dataclass(frozen=True)
class LeverArm(Unphased):
    """Adds the error of a lever arm of the antenna, which rotates with the vehicle.

    The error is Omega l, where Omega is the attitude of the reference at the stamp nearest to the fix. The vector l
    (forward, left, up) is the difference between the true and the measured lever arm::

        z' = z + Omega l,  R_true' = R_true + o o' with o = Omega l,  R' = R

    The velocity does not change, because it is assumed to come from wheels. A fix does not change if the nearest row of
    the reference has no attitude.

    Attributes:
        forward_m: forward component of l, the error of the lever arm [m].
        left_m: left component of l, the error of the lever arm [m].
        up_m: upward component of l, the error of the lever arm [m].
    """

    forward_m: Annotated[float, LENGTH] = 0.1
    left_m: Annotated[float, LENGTH] = 0.05
    up_m: Annotated[float, LENGTH] = 0.1

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the position errors that the lever arm causes. The seed has no effect.

        Raises:
            RecordingError: the recording has no position fixes, or its reference has no attitude.
        """
        position = fixes_of(recording, "so lever_arm cannot be applied; remove lever_arm.")
        euler = recording.reference.euler_rad
        if euler is None or not len(euler):
            reason = "has no attitude in its reference, which lever_arm needs; remove lever_arm."
            raise RecordingError(f"{recording.name} {reason}")
        at_fixes = euler[nearest_rows(recording.reference.t_s, position.t_s)]
        known = np.isfinite(at_fixes).all(axis=1, keepdims=True)
        arm = np.array([self.forward_m, self.left_m, self.up_m])
        offset = np.where(known, dcm_from_euler(np.where(known, at_fixes, 0.0)) @ arm, 0.0)
        return replace(recording, position=displaced(position, offset))
