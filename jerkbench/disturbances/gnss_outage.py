"""Outages: of GNSS, of positions or velocities alone, and of several lengths in turn."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from jerkbench.disturbances.common import OutageWindows, Phased, fixes_of, without
from jerkbench.errors import PluginError, RecordingError
from jerkbench.plugins import register
from jerkbench.recording import Heading, Recording


@register("disturbance", "gnss_outage")
@dataclass(frozen=True)
class GnssOutage(OutageWindows):
    """No position and no velocity in the given windows; the reference stays, and so does a wheel's speed.

    A heading that is a receiver's course goes with it, one of odometry stays.

    Attributes:
        heading: whether the dual-antenna heading goes too (it comes from the same antennas, but the paper's outage
            concerns position and velocity).
    """

    seeded: ClassVar[bool] = False

    heading: bool = False

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording without GNSS in the windows."""
        windows, velocity, heading = self.windows_in(recording), recording.velocity, recording.heading
        is_wheel = velocity is not None and velocity.frame == "speed"
        return replace(
            recording,
            position=without(recording.position, windows),
            velocity=velocity if is_wheel else without(velocity, windows),
            heading=without(heading, windows) if self._takes(heading) else heading,
            outages_s=np.concatenate([recording.outages_s, windows]),
        )

    def _takes(self, heading: Heading | None) -> bool:
        if heading is None or heading.source == "odometry":
            return False
        return heading.source == "course" or self.heading


# Intervals without position.


@register("disturbance", "position_outage")
@dataclass(frozen=True)
class PositionOutage(OutageWindows):
    """No position in the given windows; velocity, heading and reference stay.

    It shows what velocity aiding is worth: the position error grows with the integral of the velocity's error, not
    with the double integral of the accelerometer's.
    """

    seeded: ClassVar[bool] = False

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording without position in the windows.

        Raises:
            RecordingError: it has no position.
        """
        position = fixes_of(recording, "so none can be missing; leave position_outage out.")
        windows = self.windows_in(recording)
        outages_s = np.concatenate([recording.outages_s, windows])
        return replace(recording, position=without(position, windows), outages_s=outages_s)


# Intervals without velocity.


@register("disturbance", "velocity_outage")
@dataclass(frozen=True)
class VelocityOutage(OutageWindows):
    """No velocity in the given windows; position, heading and reference stay.

    Its windows count as outages too: the metrics tell how well position alone holds the filter in them.
    """

    seeded: ClassVar[bool] = False

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording without velocity in the windows.

        Raises:
            RecordingError: it has no velocity.
        """
        if recording.velocity is None:
            raise RecordingError(
                f"{recording.name} has no velocity, so none can be missing; leave velocity_outage out."
            )
        windows = self.windows_in(recording)
        outages_s = np.concatenate([recording.outages_s, windows])
        return replace(recording, velocity=without(recording.velocity, windows), outages_s=outages_s)


# Outages of one length at many starts.


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

    seeded: ClassVar[bool] = False
    cycle: ClassVar[str] = "phases"

    length_s: float = 10.0
    first_s: float = 20.0
    every_s: float = 60.0
    phases: int = 6
    phase: int | None = None
    heading: bool = False

    def __post_init__(self) -> None:
        """Check that the outages do not overlap, and that phase and phases fit."""
        if not 0 < self.length_s < self.every_s:
            raise PluginError(f"length_s is {self.length_s}; it must lie between 0 and every_s = {self.every_s}.")
        if self.phases < 1:
            raise PluginError(f"phases is {self.phases}; give 1 or more.")
        self.require_phase()

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
