"""Position, velocity and heading measurements of a true motion, with noise; the slow errors of a receiver."""

from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np

from jerkbench.arrays import FloatArray, require_axes, require_multiple, require_not_negative, require_positive
from jerkbench.errors import PluginError, require_known
from jerkbench.geometry import dcm_from_euler, wrap_angle
from jerkbench.random_streams import stream
from jerkbench.recording import (
    GRAVITY_MPS2,
    ErrorLaw,
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
    """Return where an antenna is (m, 3): p + Omega l, with the arm l forward, left, up of the body."""
    return np.asarray(enu_m + dcm_from_euler(euler_rad) @ np.asarray(arm_m)) if any(arm_m) else enu_m


def white(seed: int, sensor: str, shape: tuple[int, ...], on: bool) -> FloatArray:
    """Return noise of unit variance from the sensor's own stream; zeros when it is not ``on``."""
    return stream(seed, "dataset", sensor).standard_normal(shape) if on else np.zeros(shape)


def _covariances(sigma: tuple[float, ...], rows: int) -> FloatArray:
    return np.tile(np.diag(np.square(sigma)), (rows, 1, 1))


# The slow errors of a simulated receiver, besides white noise: they last, are late, and are of an
# antenna.

_MEASURED = ("position", "velocity", "heading")


@dataclass(frozen=True)
class SlowErrors:
    """Errors of position, velocity and heading that are not new each time; all off by default.

    The noise of a stream keeps its sigma, and has for lags tau > 0 the autocorrelation s exp(-tau/T). A fix with the
    stamp t is the place of the antenna at t - d: p + Omega l, with l what is left of the lever arm when the arm as
    measured has been taken off. The covariance is that of one measurement alone: s, d and l are not reported.

    Attributes:
        position_coloured_share: s of position, from 0 (white) to 1.
        position_coloured_time_s: T of position.
        velocity_coloured_share: s of velocity.
        velocity_coloured_time_s: T of velocity.
        heading_coloured_share: s of heading.
        heading_coloured_time_s: T of heading.
        position_latency_s: d, a multiple of the IMU's interval; no fix is of a time before the start.
        lever_arm_error_m: l, forward, left, up.
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
        """Raise a PluginError, about ``subject``, unless shares, times, latency and lever arm make sense."""
        require_axes(subject, self, ("lever_arm_error_m",), positive=False)
        require_positive(subject, self, tuple(f"{sensor}_coloured_time_s" for sensor in _MEASURED))
        for name in (f"{sensor}_coloured_share" for sensor in _MEASURED):
            if not 0 <= getattr(self, name) <= 1:
                raise PluginError(f"{subject}: {name} is {getattr(self, name)}; a share is from 0 to 1.")
        samples = self.position_latency_s * imu_rate_hz
        if not (0 <= samples < np.inf and abs(samples - round(samples)) < 1e-6):
            raise PluginError(
                f"{subject}: position_latency_s is {self.position_latency_s}; it must be 0 or a multiple of the IMU's"
                f" interval, {1 / imu_rate_hz:g} s."
            )

    def with_slow(self, sensor: str, t_s: FloatArray, white: FloatArray, seed: int) -> FloatArray:
        """Return noise (m, k) of unit variance, the white one (m, k) with the sensor's own share that lasts."""
        share, time_s = getattr(self, f"{sensor}_coloured_share"), getattr(self, f"{sensor}_coloured_time_s")
        return coloured(t_s, white, share, time_s, stream(seed, "dataset", sensor, "coloured"))


# The sensors of a simulated vehicle: from its true motion to a recording.

MAX_SAMPLES = 2_000_000
"""Of the IMU in one simulated drive: 5 h at 100 Hz; to simulate it takes 2 GB."""
START_UTC = datetime(2024, 5, 14, 14, 0, tzinfo=UTC)
_IMUS = ("per_sample", *GRADES)
_STREAMS = ("accelerometer", "gyro", "position", "velocity", "heading", "terrain", "vibration", "impacts")
"""Sources of randomness that ``silent`` can name; what a vehicle does not have is silent anyway."""


@dataclass(frozen=True)
class Sensors(SlowErrors):
    """IMU, GNSS and the reference of a simulated vehicle.

    Truth and IMU agree exactly. Over the interval that ends at its stamp each sample is

        gyro = Log(Omega_{k-1}' Omega_k)/dt
        accel = [(Omega_{k-1} + Omega_k)/2]^-1 ((v_k - v_{k-1})/dt + (0, 0, g))

    plus noise, cut off at the accelerometer's range. GNSS noise has the sigma that is reported; by default it is white.
    Every source of randomness has its own stream: switching one off does not move the others.

    Source: IEEE Std 952 for the terms of the IMU grades.

    Attributes:
        imu_rate_hz: rate of the IMU.
        gnss_rate_hz: rate of position, velocity and heading; the IMU's rate is a multiple of it.
        reference_rate_hz: rate of the reference; the IMU's rate is a multiple of it.
        imu: per_sample (the two sigmas below, nothing else), or the grade consumer, industrial or tactical.
        accel_sigma_mps2: noise of one accelerometer sample, with per_sample.
        gyro_sigma_radps: noise of one gyro sample, with per_sample.
        accel_range_g: the accelerometer's range in g; null: no limit.
        position_sigma_m: noise of position, east, north, up.
        velocity_sigma_mps: noise of velocity, east, north, up.
        heading_sigma_rad: noise of heading.
        noise: whether sensors have any errors; without, the covariances are still reported.
        silent: sources of randomness that are switched off one by one: accelerometer, gyro (each with its biases),
            position, velocity, heading, terrain, vibration, impacts. Covariances are still reported, the others draw
            what they drew.
        latitude_deg: of the origin.
        longitude_deg: of the origin.
        height_m: of the origin.
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
        """Return what the sensors see of ``truth`` (from t = 0 on, at the IMU's rate).

        ``false_mps2`` (n, m, 3) is specific force that only the accelerometer feels, within each sample.
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
        """Raise a PluginError about ``subject`` unless every choice exists and every number makes sense."""
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
        """Raise a PluginError where a drive of this length has more samples than memory should hold."""
        samples = duration_s * self.imu_rate_hz
        if samples > MAX_SAMPLES:
            raise PluginError(
                f"{subject}: {duration_s:g} s at imu_rate_hz {self.imu_rate_hz:g} are {samples:.3g} samples; a"
                f" simulated drive has at most {MAX_SAMPLES:,}: shorten it, or lower the rate."
            )

    def _imu(self, truth: Truth, seed: int, false_mps2: FloatArray | None) -> Imu:
        force, gyro = perfect_imu(truth)
        accel_errors, gyro_errors = self._sensor_errors()
        if self._on("accelerometer"):
            force = with_sensor_errors(force, accel_errors, 1.0 / self.imu_rate_hz, seed, "accelerometer")
        if self._on("gyro"):
            gyro = with_sensor_errors(gyro, gyro_errors, 1.0 / self.imu_rate_hz, seed, "gyro")
        return Imu(truth.t_s[1:], saturate(force, false_mps2, self.accel_range_g), gyro)

    def heard(self, source: str, size: float) -> float:
        """Return ``size``, or nothing where the source of randomness is silent."""
        return 0.0 if source in self.silent else size

    def _on(self, sensor: str) -> bool:
        return self.noise and sensor not in self.silent

    def _sensor_errors(self) -> tuple[SensorErrors, SensorErrors]:
        """Return the errors of accelerometer and gyro."""
        if self.imu == "per_sample":
            return SensorErrors(self.accel_sigma_mps2), SensorErrors(self.gyro_sigma_radps)
        grade = GRADES[self.imu]
        return grade.accelerometer(self.imu_rate_hz), grade.gyro(self.imu_rate_hz)

    def _drawn(self, imu: Imu, position: Position, velocity: Velocity) -> ErrorLaw | None:
        """Return the law of the errors; None where a sensor has none, or its errors are more than white noise."""
        limit = np.inf if self.accel_range_g is None else self.accel_range_g * GRAVITY_MPS2
        cut_off = bool((np.abs(imu.accel_mps2) >= limit).any())
        if self.imu != "per_sample" or cut_off or not all(map(self._on, ("accelerometer", "position", "velocity"))):
            return None
        of_position = self.position_coloured_share, self.position_coloured_time_s
        of_velocity = self.velocity_coloured_share, self.velocity_coloured_time_s
        return ErrorLaw(imu, position, velocity, self.accel_sigma_mps2, *of_position, *of_velocity)

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
        """Return (m, axes) of unit variance, white and coloured; zeros where the sensor is silent."""
        fresh = white(seed, sensor, (len(fixes.t_s), axes), self._on(sensor))
        return self.with_slow(sensor, fixes.t_s, fresh, seed) if self._on(sensor) else fresh


def every(truth: Truth, ratio: float) -> Truth:
    """Return every ``ratio``-th row; the start, row 0, is none of them."""
    step = round(ratio)
    rows = slice(step, None, step)
    return Truth(truth.t_s[rows], truth.enu_m[rows], truth.velocity_mps[rows], truth.euler_rad[rows])


def _reference(truth: Truth) -> Reference:
    euler = np.column_stack([truth.euler_rad[:, :2], wrap_angle(truth.euler_rad[:, 2])])
    return Reference(truth.t_s, "simulated truth", True, truth.enu_m, truth.velocity_mps, euler)  # noqa: FBT003 - independent
