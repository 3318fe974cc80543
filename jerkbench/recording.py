"""The recording: IMU, position, velocity, heading and the reference, validated when made and never changed.

Frames: positions and velocities are in the local tangent plane ENU at ``Recording.origin`` (WGS-84), the body is
FLU (forward, left, up). The attitude Omega = Rz(yaw) Ry(pitch) Rx(roll) turns body into ENU; positive pitch is nose
down. Specific force at rest and level is (0, 0, +g). Times are seconds from the recording's start, and each is the
time at which the value was true (the stamp less the latency). A value that is NaN is not there.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import cached_property
from html import escape
from typing import Any, ClassVar, Literal, Self

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, frozen, require, require_covariances, require_times
from jerkbench.errors import RecordingError

# The HTML that a notebook shows of an object.


def shown(title: str, values: Mapping[str, str]) -> str:
    """Return a title above a table with a line for each value."""
    lines = (f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in values.items())
    return f"<section><h4>{escape(title)}</h4><table>{''.join(lines)}</table></section>"


def stamps_text(t_s: FloatArray) -> str:
    """Say how many stamps there are, and from when to when."""
    if len(t_s) == 0:
        return "none"
    rate = f", {(len(t_s) - 1) / (t_s[-1] - t_s[0]):.3g} Hz" if len(t_s) > 1 else ""
    return f"{len(t_s)} from {t_s[0]:.2f} to {t_s[-1]:.2f} s{rate}"


# The origin of a recording's coordinates.


@dataclass(frozen=True)
class Origin:
    """Origin of the local tangent plane (WGS-84).

    Attributes:
        latitude_deg: geodetic latitude.
        longitude_deg: longitude.
        height_m: height above the ellipsoid (or above the datum that the recording's heights use).
    """

    latitude_deg: float
    longitude_deg: float
    height_m: float


# The fields of a recording's parts as checked, read-only arrays.


def freeze(owner: object, **shapes: tuple[int | None, ...]) -> None:
    """Replace each named field of a frozen dataclass by its checked read-only array."""
    for name, shape in shapes.items():
        value: Any = getattr(owner, name)
        if value is not None:
            object.__setattr__(owner, name, frozen(owner, name, value, shape))


# The streams of a recording: inertial samples, position fixes, velocities, headings.

_VELOCITY_FRAMES = ("enu", "body", "speed")
"""In which axes a velocity may be."""

HEADING_SOURCES = ("dual_antenna", "odometry", "course")
"""The sources of a heading."""


@dataclass(frozen=True, eq=False)
class Imu:
    """Inertial samples; each is the mean over the interval that ends at its stamp.

    Attributes:
        t_s: (n,) end of each sample's interval.
        accel_mps2: (n, 3) specific force, body FLU, gravity included.
        gyro_radps: (n, 3) angular rate, body FLU.
    """

    t_s: FloatArray
    accel_mps2: FloatArray
    gyro_radps: FloatArray

    def __post_init__(self) -> None:
        """Check shapes, times and that every sample is a number."""
        freeze(self, t_s=(None,))
        n = len(self.t_s)
        if n < 2:
            raise RecordingError(f"Imu.t_s has {n} samples; at least 2 are needed.")
        freeze(self, accel_mps2=(n, 3), gyro_radps=(n, 3))
        require_times(self, self.t_s)
        for name in ("accel_mps2", "gyro_radps"):
            require(np.isfinite(getattr(self, name)).all(axis=1), self, name, "the sample is NaN or infinite")

    @cached_property
    def nominal_interval_s(self) -> float:
        """The interval dt0 between samples (median)."""
        return float(np.median(np.diff(self.t_s)))

    @cached_property
    def largest_interval_s(self) -> float:
        """The largest interval between samples."""
        return float(np.diff(self.t_s).max())

    @property
    def intervals_s(self) -> FloatArray:
        """The interval (n,) that ends at each stamp; nobody saw the first one begin, so it is the nominal one."""
        return np.concatenate(([self.nominal_interval_s], np.diff(self.t_s)))


class MeasuredVectors:
    """What `Position` and `Velocity` have in common: values on three axes with their covariances.

    Attributes:
        fields: names of the fields with the values, the reported covariance and the true one.
    """

    fields: ClassVar[tuple[str, str, str]]
    t_s: FloatArray

    def __post_init__(self) -> None:
        """Check shapes, times and covariances."""
        freeze(self, t_s=(None,))
        m, (values, *covariances) = len(self.t_s), self.fields
        freeze(self, **{values: (m, 3)}, **dict.fromkeys(covariances, (m, 3, 3)))
        require_times(self, self.t_s)
        for name in covariances:
            if getattr(self, name) is not None:
                require_covariances(self, name, getattr(self, name), np.isfinite(self.values))

    @property
    def values(self) -> FloatArray:
        """What was measured (m, 3); NaN: not there."""
        return np.asarray(getattr(self, self.fields[0]))

    @property
    def reported(self) -> FloatArray:
        """The covariance (m, 3, 3) as reported."""
        return np.asarray(getattr(self, self.fields[1]))

    @property
    def true(self) -> FloatArray:
        """The true covariance (m, 3, 3) where it is known, else the reported one."""
        known = getattr(self, self.fields[2])
        return self.reported if known is None else np.asarray(known)

    def changed(self, values: FloatArray, reported: FloatArray, true: FloatArray) -> Self:
        """Return the measurements with other values (m, 3), and reported and true covariances (m, 3, 3)."""
        changes: dict[str, Any] = dict(zip(self.fields, (values, reported, true), strict=True))
        return replace(self, **changes)  # type: ignore[type-var]  # the subclasses are dataclasses


@dataclass(frozen=True, eq=False)
class Position(MeasuredVectors):
    """Position fixes.

    Attributes:
        t_s: (m,) time at which the fix was true.
        enu_m: (m, 3) east, north, up; a NaN axis was not measured.
        covariance_m2: (m, 3, 3) as reported by the receiver.
        true_covariance_m2: (m, 3, 3) what the errors were really drawn from (simulated or disturbed fixes), or None.
    """

    t_s: FloatArray
    enu_m: FloatArray
    covariance_m2: FloatArray
    true_covariance_m2: FloatArray | None = None

    fields = ("enu_m", "covariance_m2", "true_covariance_m2")


@dataclass(frozen=True, eq=False)
class Velocity(MeasuredVectors):
    """Velocity measurements.

    Attributes:
        t_s: (m,) time at which the value was true. Axes with different latencies stand in rows of their own.
        mps: (m, 3) velocity in ``frame``; a NaN axis was not measured.
        covariance_m2ps2: (m, 3, 3) in ``frame``.
        frame: "enu"; "body" (FLU), all three axes; or "speed": what a wheel measures, along the body's x axis, which a
            data set turns into the direction of travel, and across it, left and up, what is known of that (or NaN).
            The last two are turned into ENU with the attitude at that time, covariance too.
        true_covariance_m2ps2: as in Position.
    """

    t_s: FloatArray
    mps: FloatArray
    covariance_m2ps2: FloatArray
    frame: Literal["enu", "body", "speed"] = "enu"
    true_covariance_m2ps2: FloatArray | None = None

    fields = ("mps", "covariance_m2ps2", "true_covariance_m2ps2")

    def __post_init__(self) -> None:
        """Check shapes, times, covariances and the frame."""
        super().__post_init__()
        present = np.isfinite(self.mps)
        if self.frame not in _VELOCITY_FRAMES:
            raise RecordingError(f"Velocity.frame is '{self.frame}'; it must be 'enu', 'body' or 'speed'.")
        if self.frame == "body":
            require(present.all(axis=1) | ~present.any(axis=1), self, "mps", "a body velocity needs all three axes")
        if self.frame == "speed":
            require(present[:, 0] | ~present.any(axis=1), self, "mps", "a speed needs its first axis, along the course")

    @classmethod
    def along_course(
        cls, t_s: FloatArray, speed_mps: FloatArray, sigma_mps: float, across_sigma_mps: float | None = None
    ) -> Self:
        """Return a wheel's speed in the frame "speed".

        Args:
            t_s: (m,) time at which it was true.
            speed_mps: (m,) forwards; NaN: not there.
            sigma_mps: one standard deviation of it.
            across_sigma_mps: one standard deviation of the velocity to the left and upwards, taken to be zero (the
                vehicle does not slide: non-holonomic); None: nothing is known of it.
        """
        along = np.asarray(speed_mps, dtype=np.float64)
        across = np.where(np.isfinite(along), np.nan if across_sigma_mps is None else 0.0, np.nan)
        variances = np.array([sigma_mps, across_sigma_mps or 1.0, across_sigma_mps or 1.0]) ** 2
        covariance = np.tile(np.diag(variances), (len(along), 1, 1))
        return cls(t_s, np.column_stack([along, across, across]), covariance, "speed")


@dataclass(frozen=True, eq=False)
class Heading:
    """Heading measurements.

    Attributes:
        t_s: (m,) time at which the heading was true.
        yaw_rad: (m,) from east towards north.
        sigma_rad: (m,) one standard deviation.
        source: what measured it: "dual_antenna", "odometry" (the yaw of a vehicle's own odometry) or "course" (a
            receiver's course over ground, where it gives no velocity in ENU).
    """

    t_s: FloatArray
    yaw_rad: FloatArray
    sigma_rad: FloatArray
    source: Literal["dual_antenna", "odometry", "course"] = "dual_antenna"

    def __post_init__(self) -> None:
        """Check shapes, times, that every sigma is positive, and the source."""
        freeze(self, t_s=(None,))
        m = len(self.t_s)
        freeze(self, yaw_rad=(m,), sigma_rad=(m,))
        require_times(self, self.t_s)
        require(np.isfinite(self.yaw_rad), self, "yaw_rad", "the heading is not a finite number")
        require(self.sigma_rad > 0, self, "sigma_rad", "the standard deviation is not positive")
        if self.source not in HEADING_SOURCES:
            raise RecordingError(f"Heading.source is '{self.source}'; it must be one of {', '.join(HEADING_SOURCES)}.")


# The reference of a recording: what estimates are compared with.


@dataclass(frozen=True, eq=False)
class Reference:
    """The reference of the estimates, at its own stamps.

    Attributes:
        t_s: (k,) stamps.
        source: one phrase: where it comes from.
        independent: whether it shares nothing with the measurements that the filters get.
        enu_m: (k, 3) position, or None. NaN: not known there.
        velocity_mps: (k, 3) in ENU, or None.
        euler_rad: (k, 3) roll, pitch, yaw, or None.
        scored: (k,) whether errors count there (default: everywhere).
        sigma_m: (k, 3) one standard deviation of its position, east, north, up; None: not known.
    """

    t_s: FloatArray
    source: str
    independent: bool
    enu_m: FloatArray | None = None
    velocity_mps: FloatArray | None = None
    euler_rad: FloatArray | None = None
    scored: BoolArray = None  # type: ignore[assignment]  # filled in below
    sigma_m: FloatArray | None = None

    def __post_init__(self) -> None:
        """Check shapes and times; fill in ``scored``."""
        freeze(self, t_s=(None,))
        k = len(self.t_s)
        freeze(self, enu_m=(k, 3), velocity_mps=(k, 3), euler_rad=(k, 3), sigma_m=(k, 3))
        require_times(self, self.t_s)
        scored = np.ones(k, dtype=bool) if self.scored is None else np.array(self.scored, dtype=bool)
        if scored.shape != (k,):
            raise RecordingError(f"Reference.scored has shape {scored.shape}; it must be ({k},).")
        scored.flags.writeable = False
        object.__setattr__(self, "scored", scored)

    @property
    def empty(self) -> bool:
        """Whether it knows nothing: no position, no velocity, no attitude."""
        return self.enu_m is None and self.velocity_mps is None and self.euler_rad is None


# The law by which a simulation drew the errors of a recording.


@dataclass(frozen=True, eq=False)
class ErrorLaw:
    """The law of a simulation's errors, where it is linear and Gaussian; it holds for these streams and no others.

    Attributes:
        imu: each axis of each accelerometer sample has an error of its own, and nothing else is wrong with it.
        position: each axis has the error sqrt(1 - s) w + sqrt(s) b in its standard deviations: w is white, b a
            Gauss-Markov process of the time T, both of unit variance.
        velocity: alike, in ENU.
        accel_sigma_mps2: one sigma of the error of an accelerometer sample.
        position_share: s of position.
        position_time_s: T of position.
        velocity_share: s of velocity.
        velocity_time_s: T of velocity.
    """

    imu: Imu
    position: Position
    velocity: Velocity
    accel_sigma_mps2: float
    position_share: float
    position_time_s: float
    velocity_share: float
    velocity_time_s: float


# The recording: its streams, its reference, and what is known of the drive.

_MIN_FIXES = 2
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
        parameters: numbers that are random themselves, such as a random drive's speed, by the name of their column.
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
    drawn: ErrorLaw | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check that an outage ends after it begins, and that there is something without an IMU."""
        freeze(self, outages_s=(None, 2))
        object.__setattr__(self, "parameters", dict(self.parameters))
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

    def apparent_vertical(self, seconds: float) -> FloatArray:
        """Return the direction (3,) of the mean specific force over the first ``seconds``: at rest, the vertical.

        Raises:
            RecordingError: the accelerometer shows no gravity.
        """
        imu = self.inertial
        mean = imu.accel_mps2[imu.t_s < imu.t_s[0] + seconds].mean(axis=0)
        norm = float(np.linalg.norm(mean))
        if not norm > 0:
            raise RecordingError(
                f"{self.name}: the accelerometer's mean over the first {seconds:g} s is zero, so that it cannot be"
                " levelled; specific force must contain gravity."
            )
        return np.asarray(mean / norm)

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
        if self.position is None or len(self.position.t_s) < _MIN_FIXES:
            raise RecordingError(f"{self.name} has no IMU, and fewer than {_MIN_FIXES} position fixes to do without.")
        if self.velocity is not None and self.velocity.frame != "enu":
            raise RecordingError(
                f"{self.name} has no IMU, so that nothing turns its velocity in the frame '{self.velocity.frame}' into"
                " ENU; leave the velocity out, or give an IMU."
            )


# The gravity of every model.

GRAVITY_MPS2 = 9.81
"""Magnitude of gravity that the filters, the simulator and the gravity compensation use."""
