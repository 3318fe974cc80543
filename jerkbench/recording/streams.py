"""The streams of a recording: inertial samples, position fixes, velocities, headings."""

from dataclasses import dataclass
from typing import Literal, Self

import numpy as np

from jerkbench.arrays import FloatArray, require, require_covariances, require_times
from jerkbench.errors import RecordingError
from jerkbench.recording.freezing import freeze

VELOCITY_FRAMES = ("enu", "body", "speed")
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

    @property
    def nominal_interval_s(self) -> float:
        """The interval dt0 between samples (median)."""
        return float(np.median(np.diff(self.t_s)))


@dataclass(frozen=True, eq=False)
class Position:
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

    def __post_init__(self) -> None:
        """Check shapes, times and covariances."""
        freeze(self, t_s=(None,))
        m = len(self.t_s)
        freeze(self, enu_m=(m, 3), covariance_m2=(m, 3, 3), true_covariance_m2=(m, 3, 3))
        require_times(self, self.t_s)
        require_covariances(self, "covariance_m2", self.covariance_m2, np.isfinite(self.enu_m))
        if self.true_covariance_m2 is not None:
            require_covariances(self, "true_covariance_m2", self.true_covariance_m2, np.isfinite(self.enu_m))


@dataclass(frozen=True, eq=False)
class Velocity:
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

    def __post_init__(self) -> None:
        """Check shapes, times, covariances and the frame."""
        freeze(self, t_s=(None,))
        m = len(self.t_s)
        freeze(self, mps=(m, 3), covariance_m2ps2=(m, 3, 3), true_covariance_m2ps2=(m, 3, 3))
        require_times(self, self.t_s)
        present = np.isfinite(self.mps)
        require_covariances(self, "covariance_m2ps2", self.covariance_m2ps2, present)
        if self.true_covariance_m2ps2 is not None:
            require_covariances(self, "true_covariance_m2ps2", self.true_covariance_m2ps2, present)
        if self.frame not in VELOCITY_FRAMES:
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
