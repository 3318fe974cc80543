"""Measurements of simulated sensors (IMU, position, velocity, heading), with noise and time-correlated errors."""

from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from jerkbench.arrays import FloatArray, require_axes, require_multiple, require_not_negative, require_positive
from jerkbench.errors import PluginError, require_known
from jerkbench.geometry import dcm_from_euler, wrap_angle
from jerkbench.random_streams import stream
from jerkbench.recording import (
    GRAVITY_MPS2,
    ErrorModel,
    Heading,
    Imu,
    Origin,
    Position,
    Recording,
    Reference,
    Velocity,
)
from jerkbench.simulation.imu import GRADES, SensorErrors, coloured, perfect_imu, saturate, with_sensor_errors
from jerkbench.simulation.truth import Truth


def antenna_m(enu_m: FloatArray, euler_rad: FloatArray, arm_m: tuple[float, ...]) -> FloatArray:
    """Return the position p + Omega l (m, 3) of an antenna, where l is the lever arm (forward, left, up)."""
    return np.asarray(enu_m + dcm_from_euler(euler_rad) @ np.asarray(arm_m)) if any(arm_m) else enu_m


def white(seed: int, sensor: str, shape: tuple[int, ...], on: bool) -> FloatArray:
    """Return white noise of unit variance from the random stream of a sensor, or zeros if ``on`` is false."""
    return stream(seed, "dataset", sensor).standard_normal(shape) if on else np.zeros(shape)


def _covariances(sigma: tuple[float, ...], rows: int) -> FloatArray:
    return np.tile(np.diag(np.square(sigma)), (rows, 1, 1))


# Time-correlated errors of a simulated receiver: correlated noise, latency, and a wrong lever arm.

_MEASURED = ("position", "velocity", "heading")


@dataclass(frozen=True)
class SlowErrors:
    """Time-correlated errors of position, velocity and heading. By default, all these errors are disabled.

    The autocorrelation of the noise at a lag tau > 0 is s exp(-tau/T), with the fraction s and the correlation time T.
    A position fix with the stamp t is the position p + Omega l of the antenna at the time t - d, where l is the
    difference between the true and the measured lever arm. If t - d is before the start of the drive, the fix is left
    out. The reported covariance is the covariance of the noise of a single measurement, and does not include the
    correlation, the latency d and the lever arm error l.

    Attributes:
        position_coloured_share: fraction s of the variance of the position noise that is correlated, from 0 (white) to
            1 [-].
        position_coloured_time_s: correlation time T of the position noise [s].
        velocity_coloured_share: fraction s of the variance of the velocity noise that is correlated, from 0 (white) to
            1 [-].
        velocity_coloured_time_s: correlation time T of the velocity noise [s].
        heading_coloured_share: fraction s of the variance of the heading noise that is correlated, from 0 (white) to 1
            [-].
        heading_coloured_time_s: correlation time T of the heading noise [s].
        position_latency_s: latency d of the position fixes; it must be a multiple of the sampling interval of the IMU
            [s].
        lever_arm_error_m: error l of the lever arm of the antenna: forward, left, up [m].
    """

    position_coloured_share: float = 0.0
    position_coloured_time_s: float = 5.0
    velocity_coloured_share: float = 0.0
    velocity_coloured_time_s: float = 2.0
    heading_coloured_share: float = 0.0
    heading_coloured_time_s: float = 30.0
    position_latency_s: float = 0.0
    lever_arm_error_m: tuple[float, ...] = (0.0, 0.0, 0.0)

    def check_slow_errors(self, subject: str, imu_rate_hz: float) -> None:
        """Check the parameters of the time-correlated errors.

        Raises:
            PluginError: a fraction, a correlation time, the latency or the lever arm is invalid. The message starts
                with ``subject``.
        """
        require_axes(subject, self, ("lever_arm_error_m",), positive=False)
        require_positive(subject, self, tuple(f"{sensor}_coloured_time_s" for sensor in _MEASURED))
        for name in (f"{sensor}_coloured_share" for sensor in _MEASURED):
            if not 0 <= getattr(self, name) <= 1:
                raise PluginError(f"{subject}: {name} is {getattr(self, name)}; it must be from 0 to 1.")
        samples = self.position_latency_s * imu_rate_hz
        if not (0 <= samples < np.inf and abs(samples - round(samples)) < 1e-6):
            raise PluginError(
                f"{subject}: position_latency_s is {self.position_latency_s}; it must be 0 or a multiple of the"
                f" interval of the IMU, {1 / imu_rate_hz:g} s."
            )

    def with_slow(self, sensor: str, t_s: FloatArray, white: FloatArray, seed: int) -> FloatArray:
        """Return the weighted sum (m, k) of ``white`` noise and correlated noise of a sensor, with unit variance."""
        share, time_s = getattr(self, f"{sensor}_coloured_share"), getattr(self, f"{sensor}_coloured_time_s")
        return coloured(t_s, white, share, time_s, stream(seed, "dataset", sensor, "coloured"))


# Simulated sensors, which convert the true motion of a vehicle to a recording.

MAX_SAMPLES = 2_000_000
"""Maximum number of IMU samples of a simulated drive: 5 h at 100 Hz, whose simulation needs 2 GB of memory."""
START_UTC = datetime(2024, 5, 14, 14, 0, tzinfo=UTC)
_IMUS = ("per_sample", *GRADES)
_STREAMS = ("accelerometer", "gyro", "position", "velocity", "heading", "terrain", "vibration", "impacts")
"""Sources of randomness that ``silent`` can name. Sources that a vehicle does not have are ignored."""


@dataclass(frozen=True)
class Sensors(SlowErrors):
    """Simulated IMU, GNSS receiver and reference of a vehicle.

    Without sensor errors, integrating the IMU samples gives exactly the true motion. Each IMU sample is computed for
    the interval that ends at its time stamp::

        gyro = Log(Omega_{k-1}' Omega_k)/dt
        accel = [(Omega_{k-1} + Omega_k)/2]^-1 ((v_k - v_{k-1})/dt + (0, 0, g))

    Noise is added to these samples, and the accelerometer is limited to its range. The reported covariance is the true
    covariance of the GNSS noise. By default, the GNSS noise is white. Every source of randomness has an independent
    random stream, so disabling one source does not change the noise of the other sources.

    Source: IEEE Std 952 defines the error terms of the IMU grades.

    Attributes:
        imu_rate_hz: rate of the IMU [Hz].
        gnss_rate_hz: rate of position, velocity and heading; imu_rate_hz must be a multiple of this rate [Hz].
        reference_rate_hz: rate of the reference trajectory; imu_rate_hz must be a multiple of this rate [Hz].
        imu: error model of the IMU: per_sample (white noise with ``accel_sigma_mps2`` and ``gyro_sigma_radps``), or the
            grade consumer, industrial or tactical.
        accel_sigma_mps2: standard deviation of the noise of an accelerometer sample in the error model per_sample
            [m/s2].
        gyro_sigma_radps: standard deviation of the noise of a gyro sample in the error model per_sample [rad/s].
        accel_range_g: measurement range of the accelerometer; null for an unlimited range [g].
        position_sigma_m: standard deviations of the position noise: east, north, up [m].
        velocity_sigma_mps: standard deviations of the velocity noise: east, north, up [m/s].
        heading_sigma_rad: standard deviation of the heading noise [rad].
        noise: if false, the sensors have no random errors, but the reported covariances do not change.
        silent: names of the disabled sources of randomness: accelerometer, gyro (each with its biases), position,
            velocity, heading, terrain, vibration, impacts. The reported covariances and the noise of other sources do
            not change.
        latitude_deg: latitude of the origin of the local coordinates [deg].
        longitude_deg: longitude of the origin of the local coordinates [deg].
        height_m: ellipsoidal height of the origin of the local coordinates [m].
    """

    imu_rate_hz: float = 100.0
    gnss_rate_hz: float = 5.0
    reference_rate_hz: float = 100.0
    imu: str = "per_sample"
    accel_sigma_mps2: float = 0.02
    gyro_sigma_radps: float = 0.0017
    accel_range_g: float | None = 4.0
    position_sigma_m: tuple[float, ...] = (0.01, 0.01, 0.02)
    velocity_sigma_mps: tuple[float, ...] = (0.03, 0.03, 0.06)
    heading_sigma_rad: float = 0.0087
    noise: bool = True
    silent: tuple[str, ...] = ()
    latitude_deg: float = 42.03
    longitude_deg: float = -93.64
    height_m: float = 300.0

    def record(
        self, name: str, truth: Truth, seed: int, static_start_s: float, false_mps2: FloatArray | None = None
    ) -> Recording:
        """Simulate the measurements of all sensors for a given true motion, and return the recording.

        Args:
            name: name of the recording.
            truth: true motion, which must start at t = 0 and have the rate of the IMU.
            seed: seed of all random streams.
            static_start_s: duration of the rest at the start [s].
            false_mps2: (n, m, 3) false specific force, which the accelerometer measures without a corresponding motion
                [m/s2].
        """
        fixes = every(truth, self.imu_rate_hz / self.gnss_rate_hz)
        imu = self._imu(truth, seed, false_mps2)
        position, velocity = self._position(truth, fixes, seed), self._velocity(fixes, seed)
        return Recording(
            name=name,
            imu=imu,
            reference=_reference(every(truth, self.imu_rate_hz / self.reference_rate_hz)),
            position=position,
            velocity=velocity,
            heading=self._heading(fixes, seed),
            origin=Origin(self.latitude_deg, self.longitude_deg, self.height_m),
            start_utc=START_UTC,
            static_start_s=static_start_s,
            drawn=self._drawn(imu, position, velocity) if false_mps2 is None else None,
        )

    def check_sensors(self, subject: str) -> None:
        """Check the parameters of the sensors.

        Raises:
            PluginError: a parameter is invalid. The error message contains ``subject``.
        """
        require_known(f"imu of {subject}", self.imu, _IMUS)
        for source in self.silent:
            require_known(f"source of randomness of {subject}", source, _STREAMS)
        require_positive(subject, self, ("imu_rate_hz", "gnss_rate_hz", "reference_rate_hz", "heading_sigma_rad"))
        require_not_negative(subject, self, ("accel_sigma_mps2", "gyro_sigma_radps"))
        require_axes(subject, self, ("position_sigma_m", "velocity_sigma_mps"), positive=True)
        if self.accel_range_g is not None:
            require_positive(subject, self, ("accel_range_g",))
        for low in ("gnss_rate_hz", "reference_rate_hz"):
            require_multiple(subject, self, "imu_rate_hz", low)
        self.check_slow_errors(subject, self.imu_rate_hz)

    def check_length(self, subject: str, duration_s: float) -> None:
        """Check that a drive of ``duration_s`` has at most `MAX_SAMPLES` samples of the IMU.

        Raises:
            PluginError: the drive has more than `MAX_SAMPLES` samples of the IMU.
        """
        samples = duration_s * self.imu_rate_hz
        if samples > MAX_SAMPLES:
            raise PluginError(
                f"{subject}: {duration_s:g} s with imu_rate_hz={self.imu_rate_hz:g} give {samples:.3g} samples, but a"
                f" simulated drive has at most {MAX_SAMPLES:,}. Decrease the duration or imu_rate_hz."
            )

    def _imu(self, truth: Truth, seed: int, false_mps2: FloatArray | None) -> Imu:
        force, gyro = perfect_imu(truth)
        accel_errors, gyro_errors = self._sensor_errors()
        if self._on("accelerometer"):
            force = with_sensor_errors(force, accel_errors, 1.0 / self.imu_rate_hz, seed, "accelerometer")
        if self._on("gyro"):
            gyro = with_sensor_errors(gyro, gyro_errors, 1.0 / self.imu_rate_hz, seed, "gyro")
        return Imu(truth.t_s[1:], saturate(force, false_mps2, self.accel_range_g), gyro)

    def unless_silent(self, source: str, size: float) -> float:
        """Return ``size``, or 0 if ``silent`` disables this source of randomness."""
        return 0.0 if source in self.silent else size

    def _on(self, sensor: str) -> bool:
        return self.noise and sensor not in self.silent

    def _sensor_errors(self) -> tuple[SensorErrors, SensorErrors]:
        if self.imu == "per_sample":
            return SensorErrors(self.accel_sigma_mps2), SensorErrors(self.gyro_sigma_radps)
        grade = GRADES[self.imu]
        return grade.accelerometer(self.imu_rate_hz), grade.gyro(self.imu_rate_hz)

    def _drawn(self, imu: Imu, position: Position, velocity: Velocity) -> ErrorModel | None:
        """Return the distribution of the measurement errors, or None if an `ErrorModel` cannot describe it."""
        limit = np.inf if self.accel_range_g is None else self.accel_range_g * GRAVITY_MPS2
        limited = bool((np.abs(imu.accel_mps2) >= limit).any())
        if self.imu != "per_sample" or limited or not all(map(self._on, ("accelerometer", "position", "velocity"))):
            return None
        of_position = self.position_coloured_share, self.position_coloured_time_s
        of_velocity = self.velocity_coloured_share, self.velocity_coloured_time_s
        return ErrorModel(imu, position, velocity, self.accel_sigma_mps2, *of_position, *of_velocity)

    def _position(self, truth: Truth, fixes: Truth, seed: int) -> Position:
        late = round(self.position_latency_s * self.imu_rate_hz)
        step = round(self.imu_rate_hz / self.gnss_rate_hz)
        rows = np.arange(step, len(truth.t_s), step) - late
        taken = rows >= 0
        antenna = antenna_m(truth.enu_m[rows[taken]], truth.euler_rad[rows[taken]], self.lever_arm_error_m)
        noise = self._noise("position", fixes, 3, seed)[taken]
        sigma_m = self.position_sigma_m
        return Position(fixes.t_s[taken], antenna + noise * np.asarray(sigma_m), _covariances(sigma_m, len(antenna)))

    def _velocity(self, fixes: Truth, seed: int) -> Velocity:
        sigma_mps = self.velocity_sigma_mps
        mps = fixes.velocity_mps + self._noise("velocity", fixes, 3, seed) * np.asarray(sigma_mps)
        return Velocity(fixes.t_s, mps, _covariances(sigma_mps, len(mps)))

    def _heading(self, fixes: Truth, seed: int) -> Heading:
        yaw_rad = fixes.euler_rad[:, 2] + self.heading_sigma_rad * self._noise("heading", fixes, 1, seed)[:, 0]
        return Heading(fixes.t_s, wrap_angle(yaw_rad), np.full(len(yaw_rad), self.heading_sigma_rad))

    def _noise(self, sensor: str, fixes: Truth, axes: int, seed: int) -> FloatArray:
        """Return white plus correlated noise (m, axes) with the total variance 1, or zeros for a disabled sensor."""
        fresh = white(seed, sensor, (len(fixes.t_s), axes), self._on(sensor))
        return self.with_slow(sensor, fixes.t_s, fresh, seed) if self._on(sensor) else fresh


def every(truth: Truth, ratio: float) -> Truth:
    """Return every ``ratio``-th row of the true motion. The first row (the start) is not included."""
    step = round(ratio)
    rows = slice(step, None, step)
    return Truth(truth.t_s[rows], truth.enu_m[rows], truth.velocity_mps[rows], truth.euler_rad[rows])


def _reference(truth: Truth) -> Reference:
    euler = np.column_stack([truth.euler_rad[:, :2], wrap_angle(truth.euler_rad[:, 2])])
    return Reference(truth.t_s, "simulated truth", True, truth.enu_m, truth.velocity_mps, euler)  # noqa: FBT003 - independent
