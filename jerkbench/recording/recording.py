"""The recording: its streams, its reference, and what is known of the drive."""

from dataclasses import dataclass, field
from datetime import datetime

import numpy as np

from jerkbench.arrays import FloatArray, require
from jerkbench.errors import RecordingError
from jerkbench.notebook import shown, stamps_text
from jerkbench.recording.drawn import Drawn
from jerkbench.recording.freezing import freeze
from jerkbench.recording.origin import Origin
from jerkbench.recording.reference import Reference
from jerkbench.recording.streams import Heading, Imu, Position, Velocity

LEAST_FIXES = 2
"""A recording without an IMU has at least so many: its steps are those from fix to fix."""


@dataclass(frozen=True, eq=False)
class Recording:
    """One drive, as the filters see it, with its reference.

    Attributes:
        name: what tables call it.
        imu: inertial samples, or None: then only filters that take no acceleration run over it, from fix to fix.
        reference: what is compared with.
        position: fixes, or None.
        velocity: velocity measurements, or None.
        heading: headings of one source, or None.
        origin: origin of ENU, or None where nothing is known of it.
        start_utc: time of t_s = 0, or None.
        static_start_s: how long it stands still at the start (for the alignment); 0: it moves from the start.
        outages_s: (k, 2) begin and end of each interval without aiding (for the metrics).
        notes: sentences that a reader of the table has to know.
        drawn: the law of its errors, where a simulation knows it, with the streams as they were drawn; or None.
    """

    name: str
    imu: Imu | None
    reference: Reference
    position: Position | None = None
    velocity: Velocity | None = None
    heading: Heading | None = None
    origin: Origin | None = None
    start_utc: datetime | None = None
    static_start_s: float = 0.0
    outages_s: FloatArray = field(default_factory=lambda: np.empty((0, 2)))
    notes: tuple[str, ...] = ()
    drawn: Drawn | None = None

    def __post_init__(self) -> None:
        """Check that an outage ends after it begins, and that there is something without an IMU."""
        freeze(self, outages_s=(None, 2))
        require(
            self.outages_s[:, 1] > self.outages_s[:, 0], self, "outages_s", "the outage does not end after it begins"
        )

        if self.imu is None:
            self._require_fixes()

    @property
    def inertial(self) -> Imu:
        """The inertial samples, for what cannot do without.

        Raises:
            RecordingError: the recording has none.
        """
        if self.imu is None:
            raise RecordingError(
                f"{self.name} has no IMU: no attitude, and only filters and disturbances that need none."
            )
        return self.imu

    @property
    def clock_s(self) -> FloatArray:
        """The stamps at which something may happen, whatever is measured: the IMU's, or else all of the fixes'."""
        if self.imu is not None:
            return self.imu.t_s
        streams = [stream.t_s for stream in (self.position, self.velocity) if stream is not None]
        return np.unique(np.concatenate(streams))

    @property
    def duration_s(self) -> float:
        """Time of the last IMU sample; without an IMU, of the last fix."""
        return float(self.clock_s[-1])

    def __repr__(self) -> str:
        """Return its name, its length, and how many samples each stream has."""
        counts = {name: len(t_s) for name, t_s in self._stamps().items()} | {"reference": len(self.reference.t_s)}
        streams = ", ".join(f"{name} {count}" for name, count in counts.items())
        return f"Recording({self.name!r}, {self.duration_s:.2f} s: {streams})"

    def _repr_html_(self) -> str:
        """Return its streams and notes, as a notebook shows them."""
        lines = {name: stamps_text(t_s) for name, t_s in self._stamps().items()}
        independent = "" if self.reference.independent else ", not independent"
        lines["reference"] = f"{stamps_text(self.reference.t_s)}; {self.reference.source}{independent}"
        outages = ", ".join(f"{begin:g} to {end:g} s" for begin, end in self.outages_s)
        return shown(self.name, lines | ({"outages": outages} if outages else {}) | dict.fromkeys(self.notes, ""))

    def _stamps(self) -> dict[str, FloatArray]:
        """The stamps of each stream that is there."""
        streams = {"imu": self.imu, "position": self.position, "velocity": self.velocity, "heading": self.heading}
        return {name: stream.t_s for name, stream in streams.items() if stream is not None}

    def _require_fixes(self) -> None:
        """Check that a recording without an IMU has two fixes, and no velocity that an attitude would have to turn."""
        if self.position is None or len(self.position.t_s) < LEAST_FIXES:
            raise RecordingError(f"{self.name} has no IMU, and fewer than {LEAST_FIXES} position fixes to do without.")
        if self.velocity is not None and self.velocity.frame != "enu":
            raise RecordingError(
                f"{self.name} has no IMU, so that nothing turns its velocity in the frame '{self.velocity.frame}' into"
                " ENU; leave the velocity out, or give an IMU."
            )
