"""The recording of a drive: IMU samples, positions, velocities, headings, and the reference trajectory.

All objects are immutable and checked on creation. Positions and velocities are in the local tangent plane ENU at
``Recording.origin`` (WGS-84). The body frame is FLU (forward, left, up). The attitude Omega = Rz(yaw) Ry(pitch)
Rx(roll) rotates vectors from the body frame to ENU. With a positive pitch, the nose points down. The specific force of
a level body at rest is (0, 0, +g). Times are in seconds since the start of the recording. Each time is the time at
which its value was valid: the time stamp minus the latency. NaN marks a missing value.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import cached_property
from typing import Any, ClassVar, Literal, Self

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, frozen, require, require_covariances, require_times
from jerkbench.errors import RecordingError

# The origin of the local coordinates of a recording.


@dataclass(frozen=True)
class Origin:
    """Origin of the local tangent plane (WGS-84).

    Attributes:
        latitude_deg: Geodetic latitude [deg].
        longitude_deg: Longitude [deg].
        height_m: Height above the ellipsoid, or above the datum of the heights in the recording [m].
    """

    latitude_deg: float
    longitude_deg: float
    height_m: float


# Checks of arrays, and conversion to read-only arrays.


def freeze(owner: object, **shapes: tuple[int | None, ...]) -> None:
    """Check the shape of each named field of a frozen dataclass, and replace the field by a read-only array."""
    for name, shape in shapes.items():
        value: Any = getattr(owner, name)
        if value is not None:
            object.__setattr__(owner, name, frozen(owner, name, value, shape))


# The measurements of a recording: inertial samples, position fixes, velocities and headings.

_VELOCITY_FRAMES = ("enu", "body", "speed")
"""Possible frames of a velocity."""

HEADING_SOURCES = ("dual_antenna", "odometry", "course")
"""Possible sources of a heading."""


@dataclass(frozen=True, eq=False)
class Imu:
    """Inertial samples. Each sample is the mean over the sampling interval that ends at the time stamp of the sample.

    Attributes:
        t_s: (n,) time stamps: the end of the sampling interval of each sample [s].
        accel_mps2: (n, 3) specific force in the body frame FLU, including the reaction to gravity [m/s2].
        gyro_radps: (n, 3) angular rate in the body frame FLU [rad/s].
    """

    t_s: FloatArray
    accel_mps2: FloatArray
    gyro_radps: FloatArray

    def __post_init__(self) -> None:
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
        """Nominal sampling interval dt0: the median of the intervals [s]."""
        return float(np.median(np.diff(self.t_s)))

    @cached_property
    def largest_interval_s(self) -> float:
        """Largest interval between samples [s]."""
        return float(np.diff(self.t_s).max())

    @property
    def intervals_s(self) -> FloatArray:
        """Interval (n,) before each time stamp [s]. The first interval is unknown, so the nominal interval is used."""
        return np.concatenate(([self.nominal_interval_s], np.diff(self.t_s)))


class MeasuredVectors:
    """Base class of `Position` and `Velocity`: measured values on three axes, and the covariances of their errors.

    Attributes:
        fields: Names of the three fields that contain the values, the reported covariances and the true covariances.
    """

    fields: ClassVar[tuple[str, str, str]]
    t_s: FloatArray

    def __post_init__(self) -> None:
        freeze(self, t_s=(None,))
        m, (values, *covariances) = len(self.t_s), self.fields
        freeze(self, **{values: (m, 3)}, **dict.fromkeys(covariances, (m, 3, 3)))
        require_times(self, self.t_s)
        for name in covariances:
            if getattr(self, name) is not None:
                require_covariances(self, name, getattr(self, name), np.isfinite(self.values))

    @property
    def values(self) -> FloatArray:
        """Measured values (m, 3), with NaN on axes that were not measured."""
        return np.asarray(getattr(self, self.fields[0]))

    @property
    def reported(self) -> FloatArray:
        """Covariance (m, 3, 3) that the receiver or the data set reports."""
        return np.asarray(getattr(self, self.fields[1]))

    @property
    def true(self) -> FloatArray:
        """True covariance (m, 3, 3) if it is known, otherwise the reported covariance."""
        known = getattr(self, self.fields[2])
        return self.reported if known is None else np.asarray(known)

    def changed(self, values: FloatArray, reported: FloatArray, true: FloatArray) -> Self:
        """Return a copy with new values (m, 3), reported covariances (m, 3, 3) and true covariances (m, 3, 3)."""
        changes: dict[str, Any] = dict(zip(self.fields, (values, reported, true), strict=True))
        return replace(self, **changes)  # type: ignore[type-var]  # the subclasses are dataclasses


@dataclass(frozen=True, eq=False)
class Position(MeasuredVectors):
    """Position fixes.

    Attributes:
        t_s: (m,) times at which the values were valid [s].
        enu_m: (m, 3) position in ENU, with NaN on axes that were not measured [m].
        covariance_m2: (m, 3, 3) covariance that the receiver reports [m2].
        true_covariance_m2: (m, 3, 3) true covariance of the errors of simulated or disturbed fixes [m2], or None if the
            true covariance is not known.
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
        t_s: (m,) times at which the values were valid [s]. If the axes have different latencies, each axis has separate
            rows.
        mps: (m, 3) velocity in ``frame``, with NaN on axes that were not measured [m/s].
        covariance_m2ps2: (m, 3, 3) reported covariance of the velocity errors, in the same frame as ``mps`` [m2/s2].
        frame: Frame of the velocity: "enu", "body" (FLU, all three axes) or "speed" (speed of a wheel). The first axis
            of the frame "speed" is the direction of travel (the x axis of the body, corrected by the data set). The
            second and third axes of "speed" point left and up. An unknown component is NaN. Before a run, velocities in
            the frames "body" and "speed" are rotated into ENU with the attitude.
        true_covariance_m2ps2: (m, 3, 3) true covariance of the velocity errors [m2/s2], or None if the true covariance
            is not known.
    """

    t_s: FloatArray
    mps: FloatArray
    covariance_m2ps2: FloatArray
    frame: Literal["enu", "body", "speed"] = "enu"
    true_covariance_m2ps2: FloatArray | None = None

    fields = ("mps", "covariance_m2ps2", "true_covariance_m2ps2")

    def __post_init__(self) -> None:
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
        """Return a velocity in the frame "speed" from the speed that a wheel sensor measured.

        Args:
            t_s: (m,) times at which the values were valid [s].
            speed_mps: (m,) forward speed, with NaN if the speed was not measured [m/s].
            sigma_mps: Standard deviation of the speed [m/s].
            across_sigma_mps: Standard deviation of the pseudo-measurements "velocity to the left = 0" and "velocity
                upwards = 0" (non-holonomic constraint) [m/s], or None to omit the pseudo-measurements.
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
        t_s: (m,) times at which the values were valid [s].
        yaw_rad: (m,) measured yaw, counted from east towards north [rad].
        sigma_rad: (m,) standard deviation of yaw [rad].
        source: Sensor of the heading: "dual_antenna", "odometry" (odometry of the vehicle) or "course" (course over
            ground from a receiver that reports no velocity in ENU).
    """

    t_s: FloatArray
    yaw_rad: FloatArray
    sigma_rad: FloatArray
    source: Literal["dual_antenna", "odometry", "course"] = "dual_antenna"

    def __post_init__(self) -> None:
        freeze(self, t_s=(None,))
        m = len(self.t_s)
        freeze(self, yaw_rad=(m,), sigma_rad=(m,))
        require_times(self, self.t_s)
        require(np.isfinite(self.yaw_rad), self, "yaw_rad", "the heading is not a finite number")
        require(self.sigma_rad > 0, self, "sigma_rad", "the standard deviation is not positive")
        if self.source not in HEADING_SOURCES:
            raise RecordingError(f"Heading.source is '{self.source}'; it must be one of {', '.join(HEADING_SOURCES)}.")


# The reference of a recording.


@dataclass(frozen=True, eq=False)
class Reference:
    """The reference trajectory. The errors of estimates are computed relative to the reference.

    Attributes:
        t_s: (k,) time stamps of the reference [s].
        source: Short description of how the reference was measured or simulated.
        independent: True if the reference uses none of the sensor data that the filters use.
        enu_m: (k, 3) position in ENU [m], with NaN where it is unknown, or None if the reference has no positions.
        velocity_mps: (k, 3) velocity in ENU [m/s], or None if the velocity is not known.
        euler_rad: (k, 3) roll, pitch and yaw [rad], or None if the attitude is not known.
        scored: (k,) mask of the time stamps at which metrics evaluate errors (by default, all time stamps).
        sigma_m: (k, 3) standard deviation of the errors of the reference position in ENU [m], or None if unknown.
    """

    t_s: FloatArray
    source: str
    independent: bool
    enu_m: FloatArray | None = None
    velocity_mps: FloatArray | None = None
    euler_rad: FloatArray | None = None
    scored: BoolArray = None  # type: ignore[assignment]  # `__post_init__` replaces None
    sigma_m: FloatArray | None = None

    def __post_init__(self) -> None:
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
        """True if the reference has no position, no velocity and no attitude."""
        return self.enu_m is None and self.velocity_mps is None and self.euler_rad is None


THE_FIXES = "the fixes themselves"
"""Source of a reference that consists of the fixes that the filters use."""


# The distribution of the errors of a simulated recording.


@dataclass(frozen=True, eq=False)
class ErrorModel:
    """The distribution of the measurement errors in a linear Gaussian simulation, and the simulated measurements.

    On each axis of position and velocity, the error divided by its standard deviation is sqrt(1 - s) w + sqrt(s) b.
    Both w (white noise) and b (a Gauss-Markov process with the correlation time T) have unit variance.

    Attributes:
        imu: Simulated inertial samples. The errors of the accelerometer are white and independent between axes.
        position: Simulated position fixes, before any disturbance.
        velocity: Simulated velocities in ENU, before any disturbance.
        accel_sigma_mps2: Standard deviation of the error of an accelerometer sample [m/s2].
        position_share: Fraction s of the variance of the position errors that is correlated in time [-].
        position_time_s: Correlation time T of the position errors [s].
        velocity_share: Fraction s of the variance of the velocity errors that is correlated in time [-].
        velocity_time_s: Correlation time T of the velocity errors [s].
    """

    imu: Imu
    position: Position
    velocity: Velocity
    accel_sigma_mps2: float
    position_share: float
    position_time_s: float
    velocity_share: float
    velocity_time_s: float


# The recording: measurements, reference and metadata.

_MIN_FIXES = 2
"""Minimum number of position fixes in a recording without an IMU. The steps of a run are the intervals between them."""


@dataclass(frozen=True, eq=False)
class Recording:
    """The measurements of one drive, and the reference trajectory of the drive.

    Attributes:
        name: Name of the recording in tables.
        imu: Inertial samples, or None if the recording has no IMU. Without an IMU, only filters that do not use
            accelerations can run. The prediction steps of these filters are the intervals between measurements.
        reference: The reference trajectory.
        position: Position fixes, or None if no position was measured.
        velocity: Velocity measurements, or None if no velocity was measured.
        heading: Headings from one source, or None if the heading was not measured.
        origin: Origin of the ENU coordinates, or None if the origin is not known.
        start_utc: UTC time at t_s = 0, or None if the UTC time is not known.
        static_start_s: Duration of the standstill at the start, in which filters may align the attitude [s].
        outages_s: (k, 2) start and end of each outage of the aiding measurements, which the outage metrics read [s].
        notes: Notes about the recording, which are printed below tables.
        drawn: Distribution of the measurement errors of a simulation, or None if it is unknown or not Gaussian.
        parameters: Values of the random parameters of a simulated drive, for example its speed, by the name of the
            column in rows.csv.
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
    drawn: ErrorModel | None = None
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        freeze(self, outages_s=(None, 2))
        object.__setattr__(self, "parameters", dict(self.parameters))
        require(np.diff(self.outages_s)[:, 0] > 0, self, "outages_s", "the outage does not end after its start")
        if self.imu is None and (self.position is None or len(self.position.t_s) < _MIN_FIXES):
            raise RecordingError(f"{self.name} needs an IMU or at least {_MIN_FIXES} position fixes, but has neither.")
        if self.imu is None and self.velocity is not None and self.velocity.frame != "enu":
            raise RecordingError(f"{self.name} has a velocity in frame '{self.velocity.frame}', which needs an IMU.")

    @property
    def inertial(self) -> Imu:
        """The inertial samples. Unlike ``imu``, this property is never None.

        Raises:
            RecordingError: The recording has no IMU.
        """
        if self.imu is None:
            raise RecordingError(f"{self.name} has no IMU; use filters and disturbances that do not need an IMU.")
        return self.imu

    def apparent_vertical(self, seconds: float) -> FloatArray:
        """Return the direction of the mean specific force over the first ``seconds`` (the vertical if at rest).

        Returns:
            Unit vector (3,) along the mean specific force, in the body frame FLU.

        Raises:
            RecordingError: The mean specific force is zero.
        """
        imu = self.inertial
        mean = imu.accel_mps2[imu.t_s < imu.t_s[0] + seconds].mean(axis=0)
        norm = float(np.linalg.norm(mean))
        if not norm > 0:
            raise RecordingError(
                f"{self.name}: the mean specific force of the first {seconds:g} s is zero, but must contain gravity."
            )
        return np.asarray(mean / norm)

    @property
    def clock_s(self) -> FloatArray:
        """Time stamps of the IMU, or of all positions and velocities if the recording has no IMU [s]."""
        if self.imu is not None:
            return self.imu.t_s
        streams = [stream.t_s for stream in (self.position, self.velocity) if stream is not None]
        return np.unique(np.concatenate(streams))

    @property
    def duration_s(self) -> float:
        """Time of the last IMU sample, or of the last position or velocity if the recording has no IMU [s]."""
        return float(self.clock_s[-1])

    def __repr__(self) -> str:
        streams = {name: getattr(self, name) for name in ("imu", "position", "velocity", "heading", "reference")}
        counts = ", ".join(f"{name} {len(stream.t_s)}" for name, stream in streams.items() if stream is not None)
        return f"Recording({self.name!r}, {self.duration_s:.2f} s: {counts})"


# Gravity.

GRAVITY_MPS2 = 9.81
"""Magnitude of gravity in the filters, the simulator and the gravity compensation [m/s2]."""
