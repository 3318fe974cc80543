"""Outages: of GNSS, of positions or velocities alone, of several lengths in turn, and with false fixes after them."""

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances.common import (
    Phased,
    RegularWindows,
    displaced,
    fixes_of,
    in_each,
    in_plane,
    own_stream,
    without,
)
from jerkbench.errors import PluginError, RecordingError
from jerkbench.parameters import Limit
from jerkbench.plugins import register
from jerkbench.recording import Recording


@dataclass(frozen=True)
class OutageWindows(RegularWindows):
    """When an outage is.

    A measurement that was true at t is dropped where begin <= t < end. The windows are added to the recording's
    outages, so that metrics can look inside; one that lies outside the recording is left out, one that reaches
    over its begin or end is cut there.
    """

    fault: ClassVar[str] = "outage"

    def windows_in(self, recording: Recording) -> FloatArray:
        """Return the windows (k, 2), cut to the time of the recording."""
        start_s, end_s = float(recording.clock_s[0]), recording.duration_s
        windows = np.clip(self.windows, start_s, end_s)
        return np.asarray(windows[windows[:, 0] < windows[:, 1]])

    def announced_in(self, recording: Recording) -> Recording:
        """Return the recording with the windows among its outages."""
        return replace(recording, outages_s=np.concatenate([recording.outages_s, self.windows_in(recording)]))


@register("disturbance", "gnss_outage")
@dataclass(frozen=True)
class GnssOutage(OutageWindows):
    """No position and no velocity in the given windows; the reference stays, and so does a wheel's speed.

    A heading that is a receiver's course goes with it, one of odometry stays.

    Attributes:
        heading: whether the dual-antenna heading goes too (it comes from the same antennas, but the paper's outage
            concerns position and velocity).
    """

    heading: bool = False

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording without GNSS in the windows."""
        windows, velocity, heading = self.windows_in(recording), recording.velocity, recording.heading
        is_wheel = velocity is not None and velocity.frame == "speed"
        goes = heading is not None and (heading.source == "course" or (self.heading and heading.source != "odometry"))
        return replace(
            self.announced_in(recording),
            position=without(recording.position, windows),
            velocity=velocity if is_wheel else without(velocity, windows),
            heading=without(heading, windows) if goes else heading,
        )


@register("disturbance", "position_outage")
@dataclass(frozen=True)
class PositionOutage(OutageWindows):
    """No position in the given windows; velocity, heading and reference stay.

    It shows what velocity aiding is worth: the position error grows with the integral of the velocity's error, not
    with the double integral of the accelerometer's.
    """

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording without position in the windows.

        Raises:
            RecordingError: it has no position.
        """
        position = fixes_of(recording, "so none can be missing; leave position_outage out.")
        return replace(self.announced_in(recording), position=without(position, self.windows_in(recording)))


@register("disturbance", "velocity_outage")
@dataclass(frozen=True)
class VelocityOutage(OutageWindows):
    """No velocity in the given windows; position, heading and reference stay.

    Its windows count as outages too: the metrics tell how well position alone holds the filter in them.
    """

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording without velocity in the windows.

        Raises:
            RecordingError: it has no velocity.
        """
        if recording.velocity is None:
            raise RecordingError(
                f"{recording.name} has no velocity, so none can be missing; leave velocity_outage out."
            )
        velocity = without(recording.velocity, self.windows_in(recording))
        return replace(self.announced_in(recording), velocity=velocity)


@register("disturbance", "outage_sweep")
@dataclass(frozen=True)
class OutageSweep(Phased):
    """Outages of GNSS (as `gnss_outage`), all of one length, that begin at many places of the drive.

    With the phase p = 0 ... phases - 1, and k = 0, 1, ... as long as the outage ends within the recording::

        begin_kp = first_s + k every_s + p every_s/phases

    The phases are the replicates: seed s has the phase s mod phases, so that after ``phases`` seeds there was an
    outage from every (every_s/phases) seconds on, and none overlaps another. The begins do not depend on the length:
    sweep it (``disturbance.outage_sweep.length_s=2,5,10,20,30``) for the error against the time without GNSS; each
    length is a row of the table, and ``outage_end_m`` its error. The experiment ``outage_sweep`` does that.

    Attributes:
        length_s: of each outage.
        first_s: begin of the first, in phase 0.
        every_s: from one begin to the next in the same phase; leave the filter time to recover.
        phases: how many.
        phase: the same one for all seeds, below ``phases``; null: seed mod phases.
        heading: whether the dual-antenna heading goes too.
    """

    cycle: ClassVar[str] = "phases"

    length_s: float = 10.0
    first_s: float = 20.0
    every_s: float = 60.0
    phases: Annotated[int, Limit(lambda phases: phases >= 1, "give 1 or more.")] = 6
    phase: int | None = None
    heading: bool = False

    def __post_init__(self) -> None:
        """Check that the outages do not overlap, and that phase and phases fit."""
        super().__post_init__()
        if not 0 < self.length_s < self.every_s:
            raise PluginError(f"length_s is {self.length_s}; it must lie between 0 and every_s = {self.every_s}.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the outages of one phase.

        Raises:
            RecordingError: it is too short for an outage.
        """
        first_s = self.first_s + self.phase_of(seed) * self.every_s / self.phases
        last_s = recording.duration_s - self.length_s
        if first_s > last_s:
            raise RecordingError(
                f"{recording.name} lasts {recording.duration_s:.1f} s; an outage of {self.length_s} s from"
                f" {first_s:g} s on does not end within it: lower first_s, every_s or length_s."
            )
        count = int((last_s - first_s) // self.every_s) + 1
        outage = GnssOutage((), count, self.length_s, first_s, self.every_s, heading=self.heading)
        return outage.apply(recording, seed)


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
        offsets = self.offset_m * in_plane(own_stream(seed, "false_return", self.stream), len(windows_s))
        shift = in_each(position.t_s, false_s) @ offsets
        velocity = recording.velocity
        if velocity is not None and velocity.frame != "speed":
            velocity = without(velocity, np.concatenate([windows_s, false_s]))
        moved = without(displaced(position, shift), windows_s)
        return replace(self.announced_in(recording), position=moved, velocity=velocity)
