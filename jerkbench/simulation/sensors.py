"""Simulated sensors (IMU, position, velocity, heading), and errors of an IMU in the units of data sheets."""

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
from jerkbench.simulation.truth import Truth


def perfect_imu(truth: Truth) -> tuple[FloatArray, FloatArray]:
    """Return the error-free specific force and angular rate (n, 3) in the body frame for the n intervals of ``truth``.

    The angular rate w is the mean rate of the rotation from the start to the end of the interval. The specific force f,
    rotated with the mean of the attitudes at both ends, gives the change of the velocity::

        w_k = Log(Omega_{k-1}' Omega_k)/dt
        f_k = [(Omega_{k-1} + Omega_k)/2]^-1 ((v_k - v_{k-1})/dt + (0, 0, g))

    Therefore, integrating f with the true attitude gives exactly the true velocity. The difference between f and the
    mean specific force in the body frame is of second order in dt, like sculling and coning.
    """
    from scipy.spatial.transform import Rotation

    dcm = dcm_from_euler(truth.euler_rad)
    dt = np.diff(truth.t_s)[:, None]
    gyro = Rotation.from_matrix(dcm[:-1].transpose(0, 2, 1) @ dcm[1:]).as_rotvec() / dt
    accel = np.diff(truth.velocity_mps, axis=0) / dt + np.array([0.0, 0.0, GRAVITY_MPS2])
    force = np.linalg.solve(0.5 * (dcm[:-1] + dcm[1:]), accel[:, :, None])[:, :, 0]
    return np.asarray(force), np.asarray(gyro)


def saturate(force_mps2: FloatArray, false_mps2: FloatArray | None, range_g: float | None) -> FloatArray:
    """Add the false to the true specific force, limit the sum to +-``range_g``, and return its mean (n, 3) per sample.

    Args:
        force_mps2: (n, 3) true specific force, assumed to be constant during each sample [m/s2].
        false_mps2: (n, m, 3) false specific force at m times within each sample [m/s2]; None if the false force is
            zero.
        range_g: measurement range of each axis in units of g; None for an unlimited range.
    """
    inner = force_mps2[:, None, :] if false_mps2 is None else force_mps2[:, None, :] + false_mps2
    if range_g is not None:
        limit = range_g * GRAVITY_MPS2
        inner = np.clip(inner, -limit, limit)
    return np.asarray(inner.mean(axis=1))


# Errors of an IMU in the units of data sheets: white noise, biases, scale factors and misalignment.

BIAS_TIME_S = 100.0
"""Correlation time of the variable part of a bias [s]."""

ALLAN_FLOOR = 0.664
"""Ratio sqrt(2 ln 2/pi) of the minimum of an Allan deviation to the coefficient of flicker noise (IEEE Std 952)."""


@dataclass(frozen=True)
class SensorErrors:
    """Standard deviations, in SI units, of the errors of a sensor with three axes of the same quality.

    A measurement is (I + M) y + b_0 + b(t) + noise, where y is the true value. The matrix M contains the scale factor
    errors on its diagonal, and the misalignments in its other elements. The turn-on bias is b_0. The variable bias b(t)
    is a Gauss-Markov process with a correlation time of 100 s. For each seed, M and b_0 are random constants.

    Attributes:
        noise: standard deviation of the white noise of each sample.
        turn_on: standard deviation of the turn-on bias b_0.
        wander: standard deviation of the variable bias b(t).
        scale: standard deviation of the error of a scale factor [-].
        misalignment_rad: standard deviation of the tilt of an axis towards another axis [rad].
    """

    noise: float
    turn_on: float = 0.0
    wander: float = 0.0
    scale: float = 0.0
    misalignment_rad: float = 0.0


@dataclass(frozen=True)
class Grade:
    """Error parameters of an IMU in the units of a data sheet.

    Attributes:
        angle_random_walk_deg_per_sqrt_h: angle random walk caused by the white noise of the gyro [deg/sqrt(h)].
        velocity_random_walk_mps_per_sqrt_h: velocity random walk caused by the white noise of the accelerometer
            [m/s/sqrt(h)].
        gyro_instability_deg_per_h: minimum of the Allan deviation of the gyro [deg/h].
        accel_instability_mg: minimum of the Allan deviation of the accelerometer [mg].
        gyro_turn_on_deg_per_h: standard deviation of the turn-on bias of the gyro [deg/h].
        accel_turn_on_mg: standard deviation of the turn-on bias of the accelerometer [mg].
        gyro_scale_ppm: standard deviation of the scale factor errors of the gyro [ppm].
        accel_scale_ppm: standard deviation of the scale factor errors of the accelerometer [ppm].
        misalignment_mrad: standard deviation of the misalignments of both sensors [mrad].
    """

    angle_random_walk_deg_per_sqrt_h: float
    velocity_random_walk_mps_per_sqrt_h: float
    gyro_instability_deg_per_h: float
    accel_instability_mg: float
    gyro_turn_on_deg_per_h: float
    accel_turn_on_mg: float
    gyro_scale_ppm: float
    accel_scale_ppm: float
    misalignment_mrad: float

    def gyro(self, rate_hz: float) -> SensorErrors:
        """Return the errors [rad/s] of gyro samples that are means over the interval 1/``rate_hz``."""
        per_hour = np.deg2rad(1.0) / 3600.0
        noise = float(np.deg2rad(self.angle_random_walk_deg_per_sqrt_h) / 60.0 * np.sqrt(rate_hz))
        wander = float(self.gyro_instability_deg_per_h * per_hour / ALLAN_FLOOR)
        axes = self.gyro_scale_ppm * 1e-6, self.misalignment_mrad * 1e-3
        return SensorErrors(noise, float(self.gyro_turn_on_deg_per_h * per_hour), wander, *axes)

    def accelerometer(self, rate_hz: float) -> SensorErrors:
        """Return the errors [m/s2] of accelerometer samples that are means over the interval 1/``rate_hz``."""
        per_mg = 1e-3 * GRAVITY_MPS2
        noise = float(self.velocity_random_walk_mps_per_sqrt_h / 60.0 * np.sqrt(rate_hz))
        wander = self.accel_instability_mg * per_mg / ALLAN_FLOOR
        axes = self.accel_scale_ppm * 1e-6, self.misalignment_mrad * 1e-3
        return SensorErrors(noise, self.accel_turn_on_mg * per_mg, wander, *axes)


GRADES = {
    "consumer": Grade(0.4, 0.1, 20.0, 0.1, 1800.0, 20.0, 5000.0, 5000.0, 5.0),
    "industrial": Grade(0.3, 0.05, 8.0, 0.03, 200.0, 3.0, 1000.0, 1000.0, 1.0),
    "tactical": Grade(0.15, 0.06, 0.5, 0.05, 10.0, 0.75, 500.0, 300.0, 1.0),
}
"""Typical IMUs: the sensor of a phone, a factory-calibrated MEMS module, and the data sheet of a Safran STIM300."""


def with_sensor_errors(true: FloatArray, errors: SensorErrors, interval_s: float, seed: int, sensor: str) -> FloatArray:
    """Add errors to the measurements (n, 3) of a sensor. Each kind of error has an independent random stream.

    Args:
        true: (n, 3) measurements without errors.
        errors: standard deviations of the errors, in the unit of ``true``.
        interval_s: time between samples [s].
        seed: seed of the random streams.
        sensor: name of the sensor, which selects the random streams.
    """
    noise = stream(seed, "dataset", sensor).standard_normal(true.shape) * errors.noise
    turn_on = stream(seed, "dataset", sensor, "turn_on").standard_normal(3) * errors.turn_on
    sizes = np.where(np.eye(3), errors.scale, errors.misalignment_rad)
    axes = np.eye(3) + sizes * stream(seed, "dataset", sensor, "axes").standard_normal((3, 3))  # I + M
    disturbed = true @ axes.T + turn_on + noise
    return disturbed + _wandering(len(true), errors.wander, interval_s, seed, sensor)


def _wandering(rows: int, sigma: float, interval_s: float, seed: int, sensor: str) -> FloatArray:
    """Return a stationary Gauss-Markov process (rows, 3) with the standard deviation ``sigma``."""
    if sigma == 0:
        return np.zeros((rows, 3))
    decay = np.exp(-interval_s / BIAS_TIME_S)
    drive = stream(seed, "dataset", sensor, "wander").standard_normal((rows, 3)) * sigma
    drive[1:] *= np.sqrt(1.0 - decay**2)
    from scipy.signal import lfilter

    return np.asarray(lfilter([1.0], [1.0, -decay], drive, axis=0))


# Time-correlated errors are modelled by a first-order Gauss-Markov process.


def gauss_markov(t_s: FloatArray, time_s: float, random: np.random.Generator, axes: int = 3) -> FloatArray:
    """Return a stationary Gauss-Markov process (m, axes) at the times ``t_s`` (m,).

    The axes are independent and have unit variance. The recursion b_k = c b_{k-1} + sqrt(1 - c^2) w_k with c =
    exp(-(t_k - t_{k-1})/time) and w_k ~ N(0, I) is exact for any increasing times t_k.
    """
    process = random.standard_normal((len(t_s), axes))
    decay = np.exp(-np.diff(t_s) / time_s)
    fresh = np.sqrt(1.0 - decay**2)
    for k in range(1, len(t_s)):
        process[k] = decay[k - 1] * process[k - 1] + fresh[k - 1] * process[k]
    return process


def coloured(
    t_s: FloatArray, white: FloatArray, share: float, time_s: float, random: np.random.Generator
) -> FloatArray:
    """Return noise (m, k) of unit variance, of which the fraction ``share`` of the variance is correlated in time.

    The noise is n = sqrt(1 - share) w + sqrt(share) b, with the white noise w and the Gauss-Markov process b. The
    autocorrelation of the noise is E[n(t) n(t + tau)] = share exp(-|tau|/time) for a lag tau that is not 0.
    """
    if not share:
        return white
    slow = gauss_markov(t_s, time_s, random, white.shape[1])
    return np.asarray(np.sqrt(1.0 - share) * white + np.sqrt(share) * slow)


# The sensors of a vehicle, which convert its true motion to a recording.

MAX_SAMPLES = 2_000_000
"""Maximum number of IMU samples of a simulated drive: 5 h at 100 Hz, whose simulation needs 2 GB of memory."""
START_UTC = datetime(2024, 5, 14, 14, 0, tzinfo=UTC)
_IMUS = ("per_sample", *GRADES)
_MEASURED = ("position", "velocity", "heading")
_STREAMS = ("accelerometer", "gyro", "position", "velocity", "heading", "terrain", "vibration", "impacts")
"""Sources of randomness that ``silent`` can name. Sources that a vehicle does not have are ignored."""


@dataclass(frozen=True)
class Sensors:
    """Simulated IMU, GNSS receiver and reference of a vehicle.

    Without sensor errors, integrating the IMU samples gives exactly the true motion. Each IMU sample is computed for
    the interval that ends at its time stamp::

        gyro = Log(Omega_{k-1}' Omega_k)/dt
        accel = [(Omega_{k-1} + Omega_k)/2]^-1 ((v_k - v_{k-1})/dt + (0, 0, g))

    Noise is added to these samples, and the accelerometer is limited to its range. The reported covariance is the true
    covariance of the GNSS noise. By default, the GNSS noise is white. Every source of randomness has an independent
    random stream, so disabling one source does not change the noise of the other sources.

    The errors of position, velocity and heading may be correlated in time. The autocorrelation of the noise at a lag
    tau > 0 is s exp(-tau/T), with the fraction s and the correlation time T. A position fix with the stamp t is the
    position p + Omega l of the antenna at the time t - d, where l is the difference between the true and the measured
    lever arm. If t - d is before the start of the drive, the fix is left out. The reported covariance does not include
    the correlation, the latency d and the lever arm error l. By default, these errors are disabled.

    Source: IEEE Std 952 defines the error terms of the IMU grades.

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

    position_coloured_share: float = 0.0
    position_coloured_time_s: float = 5.0
    velocity_coloured_share: float = 0.0
    velocity_coloured_time_s: float = 2.0
    heading_coloured_share: float = 0.0
    heading_coloured_time_s: float = 30.0
    position_latency_s: float = 0.0
    lever_arm_error_m: tuple[float, ...] = (0.0, 0.0, 0.0)
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
        require_axes(subject, self, ("lever_arm_error_m",), positive=False)
        require_positive(subject, self, tuple(f"{sensor}_coloured_time_s" for sensor in _MEASURED))
        for name in (f"{sensor}_coloured_share" for sensor in _MEASURED):
            if not 0 <= getattr(self, name) <= 1:
                raise PluginError(f"{subject}: {name} is {getattr(self, name)}; it must be from 0 to 1.")
        samples = self.position_latency_s * self.imu_rate_hz
        if not (0 <= samples < np.inf and abs(samples - round(samples)) < 1e-6):
            raise PluginError(
                f"{subject}: position_latency_s is {self.position_latency_s}; it must be 0 or a multiple of the"
                f" interval of the IMU, {1 / self.imu_rate_hz:g} s."
            )

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
        accel_errors, gyro_errors = SensorErrors(self.accel_sigma_mps2), SensorErrors(self.gyro_sigma_radps)
        if self.imu != "per_sample":
            grade = GRADES[self.imu]
            accel_errors, gyro_errors = grade.accelerometer(self.imu_rate_hz), grade.gyro(self.imu_rate_hz)
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
        antenna_m, arm_m = truth.enu_m[rows[taken]], self.lever_arm_error_m
        if any(arm_m):
            antenna_m = antenna_m + dcm_from_euler(truth.euler_rad[rows[taken]]) @ np.asarray(arm_m)
        noise = self._noise("position", fixes, 3, seed)[taken]
        sigma_m = self.position_sigma_m
        return Position(fixes.t_s[taken], antenna_m + noise * np.asarray(sigma_m), _covariances(sigma_m, taken.sum()))

    def _velocity(self, fixes: Truth, seed: int) -> Velocity:
        sigma_mps = self.velocity_sigma_mps
        mps = fixes.velocity_mps + self._noise("velocity", fixes, 3, seed) * np.asarray(sigma_mps)
        return Velocity(fixes.t_s, mps, _covariances(sigma_mps, len(mps)))

    def _heading(self, fixes: Truth, seed: int) -> Heading:
        yaw_rad = fixes.euler_rad[:, 2] + self.heading_sigma_rad * self._noise("heading", fixes, 1, seed)[:, 0]
        return Heading(fixes.t_s, wrap_angle(yaw_rad), np.full(len(yaw_rad), self.heading_sigma_rad))

    def _noise(self, sensor: str, fixes: Truth, axes: int, seed: int) -> FloatArray:
        """Return white plus correlated noise (m, axes) with the total variance 1, or zeros for a disabled sensor."""
        if not self._on(sensor):
            return np.zeros((len(fixes.t_s), axes))
        white = stream(seed, "dataset", sensor).standard_normal((len(fixes.t_s), axes))
        share, time_s = getattr(self, f"{sensor}_coloured_share"), getattr(self, f"{sensor}_coloured_time_s")
        return coloured(fixes.t_s, white, share, time_s, stream(seed, "dataset", sensor, "coloured"))


def _covariances(sigma: tuple[float, ...], rows: int) -> FloatArray:
    return np.tile(np.diag(np.square(sigma)), (rows, 1, 1))


def every(truth: Truth, ratio: float) -> Truth:
    """Return every ``ratio``-th row of the true motion. The first row (the start) is not included."""
    step = round(ratio)
    rows = slice(step, None, step)
    return Truth(truth.t_s[rows], truth.enu_m[rows], truth.velocity_mps[rows], truth.euler_rad[rows])


def _reference(truth: Truth) -> Reference:
    euler = np.column_stack([truth.euler_rad[:, :2], wrap_angle(truth.euler_rad[:, 2])])
    return Reference(truth.t_s, "simulated truth", True, truth.enu_m, truth.velocity_mps, euler)  # noqa: FBT003 - independent
