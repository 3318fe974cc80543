"""Disturbances that remove measurements (outages, withheld fixes) or that reduce the scored times."""

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, linear_at, nearest_rows
from jerkbench.disturbances.common import (
    Phased,
    RegularWindows,
    Unphased,
    displaced,
    fault_stream,
    fixes_of,
    in_each,
    in_plane,
    rows_of,
    velocity_of,
    without,
)
from jerkbench.errors import PluginError, RecordingError
from jerkbench.parameters import ABOVE_ZERO, NOT_NEGATIVE, Limit
from jerkbench.plugins import register
from jerkbench.recording import Position, Recording, Reference, Velocity
from jerkbench.timeline import nanoseconds


@dataclass(frozen=True)
class OutageWindows(RegularWindows):
    """Base class of outages in time windows.

    A measurement at the time t is removed if start <= t < end. The windows are added to the outages of the recording,
    which the outage metrics use. Windows are limited to the duration of the recording.
    """

    fault: ClassVar[str] = "outage"

    def windows_in(self, recording: Recording) -> FloatArray:
        """Return the start and end times (k, 2) of the windows, limited to the duration of the recording."""
        start_s, end_s = float(recording.clock_s[0]), recording.duration_s
        windows = np.clip(self.windows, start_s, end_s)
        return np.asarray(windows[windows[:, 0] < windows[:, 1]])

    def announced_in(self, recording: Recording) -> Recording:
        """Return the recording with the windows added to its list of outages."""
        return replace(recording, outages_s=np.concatenate([recording.outages_s, self.windows_in(recording)]))


@register("disturbance", "gnss_outage")
@dataclass(frozen=True)
class GnssOutage(OutageWindows):
    """Removes position fixes and velocities in the given windows, except a wheel speed; the reference does not change.

    A heading that is the course of the receiver is also removed. A heading from odometry is not removed.

    Attributes:
        heading: if true, the dual-antenna heading is also removed. The default is false, because the outages in the
            paper of the filter `jerk` affect only position and velocity.
    """

    heading: bool = False

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording without GNSS measurements in the windows."""
        windows, velocity, heading = self.windows_in(recording), recording.velocity, recording.heading
        is_wheel = velocity is not None and velocity.frame == "speed"
        drops_heading = heading is not None and (
            heading.source == "course" or (self.heading and heading.source != "odometry")
        )
        return replace(
            self.announced_in(recording),
            position=without(recording.position, windows),
            velocity=velocity if is_wheel else without(velocity, windows),
            heading=without(heading, windows) if drops_heading else heading,
        )


@register("disturbance", "position_outage")
@dataclass(frozen=True)
class PositionOutage(OutageWindows):
    """Removes the position fixes in the given windows; velocity, heading and reference do not change.

    A position outage shows the benefit of velocity aiding: with velocities, the position error grows with the integral
    of the velocity error, and not with the double integral of the accelerometer error.
    """

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording without position fixes in the windows.

        Raises:
            RecordingError: the recording has no position fixes.
        """
        position = fixes_of(recording, "so position_outage cannot be applied; remove position_outage.")
        return replace(self.announced_in(recording), position=without(position, self.windows_in(recording)))


@register("disturbance", "velocity_outage")
@dataclass(frozen=True)
class VelocityOutage(OutageWindows):
    """Removes the velocities in the given windows; position, heading and reference do not change.

    The windows count as outages of the recording, so the outage metrics show the accuracy without velocities.
    """

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording without velocities in the windows.

        Raises:
            RecordingError: the recording has no velocities.
        """
        velocity = without(velocity_of(recording, "velocity_outage"), self.windows_in(recording))
        return replace(self.announced_in(recording), velocity=velocity)


@register("disturbance", "outage_sweep")
@dataclass(frozen=True)
class OutageSweep(Phased):
    """GNSS outages (as in `gnss_outage`) of one length that start at many times of the drive.

    In the phase p = 0 ... phases - 1, outage k = 0, 1, ... starts at the time start_kp::

        start_kp = first_s + k every_s + p every_s/phases

    An outage that does not end within the recording is omitted. Seed s uses the phase s mod phases. The outages of a
    run do not overlap, and the runs with ``phases`` different seeds together have an outage every (every_s/phases)
    seconds. The start times do not depend on ``length_s``. A sweep of the length
    (``disturbance.outage_sweep.length_s=2,5,10,20,30``) shows the error as a function of the time without GNSS. In the
    result table of this sweep, each length has a row, and the metric ``outage_end_m`` shows the error at the end of an
    outage. The experiment ``outage_sweep`` runs this sweep.

    Attributes:
        length_s: length of each outage [s].
        first_s: start of the first outage in phase 0 [s].
        every_s: time between the starts of two outages of a phase; the filter must recover within this time [s].
        phases: number of phases [-].
        phase: fixed phase of all seeds, below ``phases``; if null, seed s uses the phase s mod phases [-].
        heading: if true, the dual-antenna heading is also removed.
    """

    cycle: ClassVar[str] = "phases"

    length_s: float = 10.0
    first_s: float = 20.0
    every_s: float = 60.0
    phases: Annotated[int, Limit(lambda phases: phases >= 1, "give 1 or more.")] = 6
    phase: int | None = None
    heading: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 < self.length_s < self.every_s:
            raise PluginError(f"length_s is {self.length_s}; it must lie between 0 and every_s = {self.every_s}.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the outages of the phase that ``seed`` determines.

        Raises:
            RecordingError: no outage of the phase ends within the recording.
        """
        first_s = self.first_s + self.phase_of(seed) * self.every_s / self.phases
        last_s = recording.duration_s - self.length_s
        if first_s > last_s:
            raise RecordingError(
                f"{recording.name} lasts {recording.duration_s:.1f} s, so an outage of {self.length_s} s that starts at"
                f" {first_s:g} s does not end within the recording; decrease first_s, every_s or length_s."
            )
        count = int((last_s - first_s) // self.every_s) + 1
        outage = GnssOutage((), count, self.length_s, first_s, self.every_s, heading=self.heading)
        return outage.apply(recording, seed)


@register("disturbance", "false_return")
@dataclass(frozen=True)
class FalseReturn(OutageWindows):
    """GNSS outages that are followed by fixes with a constant offset for some time.

    In each window, position fixes and velocities are removed, except a wheel speed. During the time ``false_s`` after
    each window, the velocities are still removed, and the fixes have a horizontal offset o of length d in a random
    direction::

        z' = z + o,  R_true' = R_true + o o',  R' = R

    After the false fixes, the measurements are correct again. A filter can follow the false fixes, reject all later
    fixes, or recover.

    Attributes:
        offset_m: d, length of the offset of the false fixes [m].
        false_s: duration of the false fixes after each outage [s].
        stream: label of the random stream; disturbances of the same type need different labels to be independent.
    """

    seeded: ClassVar[bool] = True

    windows_s: tuple[tuple[float, float], ...] = ((40.0, 50.0),)
    offset_m: float = 50.0
    false_s: float = 20.0
    stream: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (0 < self.offset_m < np.inf and self.false_s > 0):
            raise PluginError(f"offset_m is {self.offset_m} and false_s is {self.false_s}; both must be above 0.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with outages and false fixes; ``seed`` determines the directions of the offsets.

        Raises:
            RecordingError: the recording has no position fixes.
        """
        position = fixes_of(recording, "so false_return cannot be applied; remove false_return.")
        windows_s = self.windows_in(recording)
        false_s = np.column_stack([windows_s[:, 1], windows_s[:, 1] + self.false_s])
        offsets = self.offset_m * in_plane(fault_stream(seed, "false_return", self.stream), len(windows_s))
        shift = in_each(position.t_s, false_s) @ offsets
        velocity = recording.velocity
        if velocity is not None and velocity.frame != "speed":
            velocity = without(velocity, np.concatenate([windows_s, false_s]))
        moved = without(displaced(position, shift), windows_s)
        return replace(self.announced_in(recording), position=moved, velocity=velocity)


@register("disturbance", "decimate_position")
@dataclass(frozen=True)
class DecimatePosition(Phased):
    """Retains only every n-th position fix; velocity and reference do not change.

    Fix i = 0, 1, 2, ... is retained if i mod n is equal to the phase. Seed s uses the phase s mod n.

    Attributes:
        every: n, one of n fixes is retained; 1 retains all fixes [fixes].
        phase: fixed phase of all seeds, below ``every``; if null, seed s uses the phase s mod every [-].
    """

    every: Annotated[int, Limit(lambda n: n >= 1, "give 1 (all fixes) or more.")] = 4
    phase: int | None = None

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with every n-th fix. The first of these fixes depends on ``seed``."""
        position = recording.position
        if position is None:
            return recording
        retained = np.arange(len(position.t_s)) % self.every == self.phase_of(seed)
        return replace(recording, position=rows_of(position, retained))


_SOURCE = "fixes of the same receiver, withheld from the filter"

SAME_RATE = 0.1
"""Maximum relative difference of the median intervals of velocities and fixes that come from the same receiver."""


@register("disturbance", "withhold")
@dataclass(frozen=True)
class Withhold(Phased):
    """Gives every n-th GNSS epoch to the filter and uses the withheld epochs as the reference.

    The filter receives epoch i = 0, 1, 2, ... if i mod n is equal to the phase. Seed s uses the phase s mod n. An
    independent reference, for example the truth of a simulation, is not replaced. The withheld fixes and the fixes of
    the filter come from the same receiver, so common errors of all fixes are not detected.

    The velocity of a withheld epoch is also withheld, because it contains information about the withheld position if
    the receiver derives its velocity from its positions. To assign velocities to epochs, velocity rows with the same
    measured axes form a group. If a group of velocity rows has the same rate as the fixes, row i of the group belongs
    to epoch i. The order of the rows is used, because latencies change the times of the rows but not their order. If a
    group with this rate does not have the same number of rows as there are fixes, a row belongs to the first fix that
    is not before the row. A group of velocity rows with another rate comes from another sensor, for example a wheel,
    and is not withheld.

    Attributes:
        every: n, the filter receives one of n epochs; at least 2 [epochs].
        phase: fixed phase of all seeds, below ``every``; if null, seed s uses the phase s mod every [-].
        velocity: if true, the velocity of a withheld epoch is also withheld.
    """

    every: Annotated[int, Limit(lambda n: n >= 2, "it must be at least 2, because 1 withholds no fix.")] = 4
    phase: int | None = None
    velocity: bool = True

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the GNSS epochs of one phase, and with the withheld epochs as the reference.

        Raises:
            RecordingError: the recording has no position fixes.
        """
        position, velocity = fixes_of(recording, "so withhold cannot be applied; remove withhold."), recording.velocity
        retained = np.arange(len(position.t_s)) % self.every == self.phase_of(seed)
        if velocity is not None and self.velocity:
            velocity = rows_of(velocity, _retained_velocity(velocity, position.t_s, retained))
        return replace(
            recording,
            position=rows_of(position, retained),
            velocity=velocity,
            reference=_reference(recording.reference, position, ~retained),
        )


def _retained_velocity(velocity: Velocity, fixes_t_s: FloatArray, retained: BoolArray) -> BoolArray:
    """Return a mask (m,) that is true for velocity rows that belong to a retained epoch or to no epoch."""
    selected = np.ones(len(velocity.t_s), dtype=bool)
    axes = np.isfinite(velocity.mps) @ np.array([1, 2, 4])
    for group in np.unique(axes):
        rows = np.flatnonzero(axes == group)
        if _same_rate(velocity.t_s[rows], fixes_t_s):
            epochs = np.arange(len(rows))
            if len(rows) != len(fixes_t_s):  # a row belongs to the first fix at or after the time of the row
                epochs = np.searchsorted(nanoseconds(fixes_t_s), nanoseconds(velocity.t_s[rows]))
            selected[rows] = retained[np.minimum(epochs, len(fixes_t_s) - 1)]
    return selected


def _same_rate(t_s: FloatArray, fixes_t_s: FloatArray) -> bool:
    if min(len(t_s), len(fixes_t_s)) < 2:
        return True  # the rate is unknown, so the rows are treated as rows of the same receiver
    interval, fixes = np.median(np.diff(t_s)), np.median(np.diff(fixes_t_s))
    return bool(abs(interval - fixes) <= SAME_RATE * fixes)


def _reference(reference: Reference, position: Position, withheld: BoolArray) -> Reference:
    """Return the withheld fixes as the reference, or an independent reference without a change.

    If the old reference has a row at each withheld stamp, the rows of the old reference at these stamps are returned.
    """
    if reference.independent:
        return reference
    t_s = position.t_s[withheld]
    same = np.isin(nanoseconds(reference.t_s), nanoseconds(t_s))
    if reference.enu_m is not None and same.sum() == len(t_s):
        return rows_of(reference, same, source=_SOURCE)
    return Reference(t_s, _SOURCE, independent=False, enu_m=position.enu_m[withheld])


# Scoring of errors with a limited rate, and only while the vehicle moves.

HALF_S = 0.5
"""Half of the interval over which the speed of the reference is computed [s]."""

SPEED_GAP_S = 1.5
"""Maximum interval between stamps of the reference over which its speed is computed [s]."""


@register("disturbance", "score_moving")
@dataclass(frozen=True)
class ScoreMoving(Unphased):
    """Scores errors only while the reference moves, and at most at the rate ``rate_hz``.

    Without this disturbance, the errors of a vehicle that is often stationary mostly show the accuracy at rest. In
    addition, a reference with 100 Hz has a hundred times as many scored errors as a reference with 1 Hz. The horizontal
    speed of the reference is |p(t + 0.5 s) - p(t - 0.5 s)|/1 s, where the position p is interpolated linearly. In gaps
    of the reference of more than 1.5 s, errors are not scored. In each interval of length 1/``rate_hz``, only the first
    stamp in motion is scored.

    Attributes:
        rate_hz: maximum rate at which errors are scored [Hz].
        slowest_mps: minimum horizontal speed at which errors are scored [m/s].
        fix_s: maximum time between a scored stamp and the nearest fix [s], or 0 to score errors in gaps of fixes too.
    """

    rate_hz: Annotated[float, ABOVE_ZERO] = 1.0
    slowest_mps: Annotated[float, NOT_NEGATIVE] = 0.5
    fix_s: Annotated[float, NOT_NEGATIVE] = 0.0

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with fewer scored stamps of the reference. The seed has no effect.

        Raises:
            RecordingError: the reference has no positions, or ``fix_s`` is not 0 and the recording has no fixes.
        """
        reference = recording.reference
        counts = reference.scored & (horizontal_speed(reference, recording.name) > self.slowest_mps)
        if self.fix_s:
            fix_s = fixes_of(recording, "which fix_s needs; set score_moving.fix_s to 0.").t_s
            counts &= np.abs(fix_s[nearest_rows(fix_s, reference.t_s)] - reference.t_s) <= self.fix_s
        rows = np.flatnonzero(counts)
        _, first = np.unique(np.floor(reference.t_s[rows] * self.rate_hz + 1e-6), return_index=True)
        scored = np.isin(np.arange(len(counts)), rows[first])
        return replace(recording, reference=replace(reference, scored=scored))


def horizontal_speed(reference: Reference, name: str) -> FloatArray:
    """Return the mean horizontal speed (k,) in the second around each stamp [m/s]; an unknown speed is NaN.

    Raises:
        RecordingError: the reference of the recording ``name`` has fewer than two positions.
    """
    enu_m = reference.enu_m
    known = np.isfinite(enu_m).all(axis=1) if enu_m is not None else np.zeros(0, dtype=np.bool_)
    if enu_m is None or known.sum() < 2:
        raise RecordingError(f"The reference of {name} has fewer than two positions, so the speed is unknown.")
    t_s, horizontal_m = reference.t_s[known], enu_m[known, :2]
    late, early = (linear_at(t_s, horizontal_m, reference.t_s + shift, SPEED_GAP_S) for shift in (HALF_S, -HALF_S))
    return np.asarray(np.hypot(*(late - early).T) / (2.0 * HALF_S))
