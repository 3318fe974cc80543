"""The parameters of the inertial filters, and the inputs of a run that depend on these parameters."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import FloatArray, Same
from jerkbench.attitude.yaw import estimate_yaw, required_track
from jerkbench.errors import PluginError, RecordingError, require_known
from jerkbench.estimate import Attitude
from jerkbench.inertial.run_inputs import (
    Constraints,
    Events,
    InertialInputs,
    InertialSettings,
    StartSigmas,
    align,
    merge_events,
    still_samples,
    with_body_velocity,
)
from jerkbench.inertial.state import NavigationState, SensorNoise, earth_at
from jerkbench.parameters import DefaultOrigin, Limit, Limited, Range
from jerkbench.recording import GRAVITY_MPS2, Heading, Imu, Recording
from jerkbench.timeline import Timeline, build_timeline

INERTIAL_YAW_SOURCES = ("attitude", "track")

DEG_PER_H = np.deg2rad(1.0) / 3600.0
PER_SQRT_H = 1.0 / 60.0
_MG = 1e-3 * GRAVITY_MPS2

_GRADES = "ours: from a tactical sensor to the sensor of a phone on a vibrating vehicle"

OF_FIELD = DefaultOrigin("data sheet: the IMU of the simulated field, 0.0017 rad/s and 0.02 m/s2 per sample at 100 Hz")
INDUSTRIAL = DefaultOrigin("ours: order of magnitude of an industrial MEMS module")

POSITIVE_SIGMA = Limit(lambda value: 0 < value < math.inf, "it must be positive.")
MORE_THAN_0 = Limit(lambda value: value > 0, "it must be positive.")
MAY_BE_OFF = Limit(lambda value: 0 <= value < math.inf, "it must be 0 (constant) or more.")
OF_THREE = Limit(lambda arm: len(arm) == 3, "give three numbers: forward, left, up.")


@dataclass(frozen=True)
class Eskf15Parameters(Limited):
    """The parameters of `eskf15` and of the filters that are based on it.

    All lever arms are vectors in the body frame (forward, left, up).

    Attributes:
        angle_random_walk_deg_per_sqrt_h: density of the white noise of the gyro [deg/sqrt(h)].
        velocity_random_walk_mps_per_sqrt_h: density of the white noise of the accelerometer [m/s/sqrt(h)].
        gyro_instability_deg_per_h: standard deviation sigma of the time-varying part of the gyro bias, or 0 for a
            constant gyro bias [deg/h].
        gyro_correlation_s: tau, correlation time of the time-varying part of the gyro bias [s].
        accel_instability_mg: standard deviation sigma of the time-varying part of the accelerometer bias, or 0 for a
            constant bias [mg].
        accel_correlation_s: tau, correlation time of the time-varying part of the accelerometer bias [s].
        gyro_turn_on_deg_per_h: standard deviation of the initial gyro bias [deg/h].
        accel_turn_on_mg: standard deviation of the initial accelerometer bias [mg].
        gyro_bias_from_rest: if true, the initial gyro bias is the mean gyro output while the vehicle is at rest at the
            start.
        yaw_source: source of the initial yaw, either "attitude" (the attitude filter) or "track" (the position fixes).
        initial_yaw_sigma_rad: minimum standard deviation of the initial yaw [rad].
        track_least_m: minimum distance between two position fixes from which a course is computed [m].
        position_sigma_m: standard deviation of each axis of a position fix, or null to use the reported covariance [m].
        antenna_m: lever arm from the IMU to the GNSS antenna [m].
        use_velocity: if true, the filter uses the measured velocities.
        use_heading: if true, the filter uses the measured headings, and treats a measured course as the heading of the
            body.
        wheel_scale: if true, the filter estimates the scale error of the wheel speed, which requires a measured
            velocity in the frame "speed".
        wheel_scale_sigma: initial standard deviation of the scale error of the wheel speed [-].
        zero_velocity: if true, the filter applies zero-velocity updates while the vehicle is stationary.
        zero_velocity_sigma_mps: standard deviation of each axis of a zero-velocity update, and of the initial velocity
            if the vehicle is at rest at the start [m/s].
        still_window_s: minimum time for which the IMU must be stationary before a zero-velocity update [s].
        still_accel_mps2: standard deviation of the accelerometer output (norm of 3 axes) below which the IMU is
            regarded as stationary [m/s2].
        still_gyro_radps: standard deviation of the gyro output (norm of 3 axes) below which the IMU is regarded as
            stationary [rad/s].
        still_below_mps: estimated speed below which zero-velocity updates are applied [m/s].
        nonholonomic: if true, the filter constrains the lateral and vertical velocity in the body frame to zero.
        nonholonomic_sigma_mps: standard deviation of each component of the non-holonomic constraint [m/s].
        nonholonomic_point_m: lever arm from the IMU to the point at which the non-holonomic constraint and the wheel
            speed apply, usually the rear axle [m].
        constraint_interval_s: time between two zero-velocity or non-holonomic updates [s].
        reference_point_m: lever arm from the IMU to the point whose position and velocity the filter returns [m].
        earth_rotation: if true, the filter compensates the Earth's rotation. The Earth's rotation is not compensated if
            the recording has no origin. The compensation requires gyro data that still contain their mean at rest.
        earth_curvature: if true, the direction of gravity in the filter depends on the position.
    """

    title: ClassVar[str]
    invariant: ClassVar[bool]
    unsupported: ClassVar[tuple[str, ...]] = ()
    """Names of the parameters that the filter does not support."""

    angle_random_walk_deg_per_sqrt_h: Annotated[
        float, POSITIVE_SIGMA, Range(0.01, 60.0, log=True, source=_GRADES), OF_FIELD
    ] = 0.6
    velocity_random_walk_mps_per_sqrt_h: Annotated[
        float, POSITIVE_SIGMA, Range(0.005, 20.0, log=True, source=_GRADES), OF_FIELD
    ] = 0.12
    gyro_instability_deg_per_h: Annotated[
        float, MAY_BE_OFF, Range(0.1, 500.0, log=True, source=_GRADES), INDUSTRIAL
    ] = 5.0
    gyro_correlation_s: Annotated[float, MORE_THAN_0, DefaultOrigin("ours: long against an outage")] = 1000.0
    accel_instability_mg: Annotated[float, MAY_BE_OFF, Range(0.005, 10.0, log=True, source=_GRADES), INDUSTRIAL] = 0.1
    accel_correlation_s: Annotated[float, MORE_THAN_0, DefaultOrigin("ours: long against an outage")] = 1000.0
    gyro_turn_on_deg_per_h: Annotated[float, POSITIVE_SIGMA, INDUSTRIAL] = 500.0
    accel_turn_on_mg: Annotated[float, POSITIVE_SIGMA, INDUSTRIAL] = 10.0
    gyro_bias_from_rest: bool = True
    yaw_source: str = "attitude"
    initial_yaw_sigma_rad: Annotated[float, POSITIVE_SIGMA, DefaultOrigin("ours: 3 degrees")] = 0.05
    track_least_m: Annotated[float, MORE_THAN_0] = 1.0
    position_sigma_m: Annotated[float | None, POSITIVE_SIGMA] = None
    antenna_m: Annotated[tuple[float, ...], OF_THREE] = (0.0, 0.0, 0.0)
    use_velocity: bool = True
    use_heading: bool = True
    wheel_scale: bool = False
    wheel_scale_sigma: Annotated[float, POSITIVE_SIGMA, DefaultOrigin("ours: 2 %, tyres")] = 0.02
    zero_velocity: bool = False
    zero_velocity_sigma_mps: Annotated[float, POSITIVE_SIGMA, DefaultOrigin("ours")] = 0.02
    still_window_s: Annotated[float, MORE_THAN_0] = 1.0
    still_accel_mps2: Annotated[float, MORE_THAN_0] = 0.1
    still_gyro_radps: Annotated[float, MORE_THAN_0] = 0.01
    still_below_mps: Annotated[float, MORE_THAN_0] = 0.3
    nonholonomic: bool = False
    nonholonomic_sigma_mps: Annotated[
        float,
        POSITIVE_SIGMA,
        Range(0.02, 2.0, log=True, source="ours: from a car on rails to a tractor on a slope"),
        DefaultOrigin("ours"),
    ] = 0.2
    nonholonomic_point_m: Annotated[tuple[float, ...], OF_THREE] = (0.0, 0.0, 0.0)
    constraint_interval_s: Annotated[float, MORE_THAN_0] = 0.1
    reference_point_m: Annotated[tuple[float, ...], OF_THREE] = (0.0, 0.0, 0.0)
    earth_rotation: bool = False
    earth_curvature: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        require_known(f"yaw_source of filter {self.title}", self.yaw_source, INERTIAL_YAW_SOURCES)
        for name in self.unsupported:
            if value := getattr(self, name):
                raise PluginError(
                    f"{self.title}.{name} is {value}, but {self.title} does not support this parameter; set {name} to 0"
                    " or false."
                )

    def sensor_noise(self) -> SensorNoise:
        """Return the power spectral densities of the process noise in SI units."""
        gyro, accel = self.gyro_instability_deg_per_h * DEG_PER_H, self.accel_instability_mg * _MG
        return SensorNoise(
            angle=float(np.deg2rad(self.angle_random_walk_deg_per_sqrt_h) * PER_SQRT_H) ** 2,
            velocity=(self.velocity_random_walk_mps_per_sqrt_h * PER_SQRT_H) ** 2,
            gyro_bias=float(2.0 * gyro**2 / self.gyro_correlation_s),
            accel_bias=float(2.0 * accel**2 / self.accel_correlation_s),
        )


# Functions that compute the inputs of an inertial run from the parameters.

YAW_WALK = 2e-4
"""Random walk of the yaw of the track [rad/sqrt(s)], equal to the default of the attitude filters."""

COURSE_SIGMA_RAD = 0.0087
"""Minimum standard deviation of a course of the track [rad], equal to the default of the attitude filters."""


def run_inputs(
    parameters: Eskf15Parameters, recording: Recording, attitude: Attitude, timeline: Timeline | None = None
) -> InertialInputs:
    """Return the inputs of a run of an inertial filter, except the adaptation.

    Args:
        parameters: parameters of the inertial filter.
        recording: recording with the IMU data and the measurements.
        attitude: output of the attitude filter, from which the run is initialised.
        timeline: timeline of ``recording`` and ``attitude``, or None to compute the timeline. A timeline may be passed
            only if `takes_timeline` returns true.
    """
    recording = aided(parameters, recording)
    timeline = _timeline(recording, attitude) if timeline is None else timeline
    headings = recording.heading if parameters.use_heading else None
    steps = Same(timeline.t_s, timeline.update, timeline.reference)
    events = _events(steps, recording.inertial, headings, parameters.constraint_interval_s)
    start = _start(parameters, recording, attitude, timeline)
    return InertialInputs(recording.inertial, timeline, headings, events, start, _settings(parameters, recording))


@lru_cache(maxsize=32)  # the number of recordings in the cache
def _events(steps: Same, imu: Imu, headings: Heading | None, constraint_interval_s: float) -> Events:
    t_s, updates, references = steps.objects
    return merge_events(t_s, updates, references, imu, headings, constraint_interval_s)


def takes_timeline(parameters: Eskf15Parameters, recording: Recording) -> bool:
    """Return whether a run can use the timeline of ``recording`` without changes to measurements and covariances."""
    unchanged = aided(parameters, recording) is recording and _velocity_frame(recording) == "enu"
    return unchanged and parameters.yaw_source != "track"


def aided(parameters: Eskf15Parameters, recording: Recording) -> Recording:
    """Return the recording with only the measurements that the filter uses.

    If ``position_sigma_m`` is set, the covariances of the position fixes are replaced.

    Raises:
        RecordingError: ``wheel_scale`` is set, but the recording has no wheel speed.
    """
    if not parameters.use_velocity:
        recording = replace(recording, velocity=None)
    if parameters.wheel_scale and _velocity_frame(recording) != "speed":
        raise RecordingError(
            f"{recording.name}: {parameters.title}.wheel_scale needs a wheel speed, but the frame of the velocity is"
            f" {'none' if recording.velocity is None else recording.velocity.frame}; set wheel_scale to false."
        )
    if parameters.position_sigma_m is not None and recording.position is not None:
        covariance = np.broadcast_to(parameters.position_sigma_m**2 * np.eye(3), recording.position.covariance_m2.shape)
        recording = replace(recording, position=replace(recording.position, covariance_m2=covariance))
    return recording


def _start(
    parameters: Eskf15Parameters, recording: Recording, attitude: Attitude, timeline: Timeline
) -> tuple[NavigationState, FloatArray]:
    yaw_rad, yaw_sigma_rad = first_yaw(parameters, recording, attitude, int(timeline.sample[0]))
    sigmas = StartSigmas(
        gyro_bias_radps=float(parameters.gyro_turn_on_deg_per_h * DEG_PER_H),
        accel_bias_mps2=parameters.accel_turn_on_mg * _MG,
        yaw_rad=max(parameters.initial_yaw_sigma_rad, yaw_sigma_rad),
        still_mps=parameters.zero_velocity_sigma_mps,
        wheel_scale=parameters.wheel_scale_sigma if parameters.wheel_scale else 0.0,
    )
    noise, from_rest = parameters.sensor_noise(), parameters.gyro_bias_from_rest
    state, P = align(recording, attitude, timeline, yaw_rad, sigmas, noise, gyro_bias_from_rest=from_rest)
    if _velocity_frame(recording) != "enu":
        state, P = with_body_velocity(state, P, attitude.dcm[timeline.sample[0]])
    return state._replace(position_m=state.position_m - state.dcm @ np.array(parameters.antenna_m)), P


def first_yaw(
    parameters: Eskf15Parameters, recording: Recording, attitude: Attitude, sample: int
) -> tuple[float, float]:
    """Return the initial yaw and its standard deviation [rad], which is 0 if the attitude filter reports none."""
    if parameters.yaw_source == "track":
        track, (roll, pitch, _) = required_track(recording, parameters.track_least_m), attitude.euler_rad.T
        yaw = estimate_yaw(recording.inertial, roll, pitch, track, YAW_WALK, COURSE_SIGMA_RAD)
        return float(yaw.rad[sample]), float(yaw.sigma_rad[sample])
    known = attitude.yaw_sigma_rad
    return float(attitude.euler_rad[sample, 2]), 0.0 if known is None else float(known[sample])


def _settings(parameters: Eskf15Parameters, recording: Recording) -> InertialSettings:
    imu = recording.inertial
    still = np.zeros(len(imu.t_s), dtype=np.bool_)
    if parameters.zero_velocity:
        still = still_samples(imu, parameters.still_window_s, parameters.still_accel_mps2, parameters.still_gyro_radps)
    constraints = Constraints(
        still=still,
        still_below_mps=parameters.still_below_mps,
        still_sigma_mps=parameters.zero_velocity_sigma_mps,
        sideways_sigma_mps=parameters.nonholonomic_sigma_mps if parameters.nonholonomic else 0.0,
        sideways_point_m=np.array(parameters.nonholonomic_point_m),
    )
    return InertialSettings(
        noise=parameters.sensor_noise(),
        earth=earth_at(recording.origin, rotates=parameters.earth_rotation, curved=parameters.earth_curvature),
        antenna_m=np.array(parameters.antenna_m),
        reference_point_m=np.array(parameters.reference_point_m),
        velocity_frame=_velocity_frame(recording),
        constraints=constraints,
        invariant=parameters.invariant,
    )


def _timeline(recording: Recording, attitude: Attitude) -> Timeline:
    """Return the timeline with measured velocities in the frame of the measurement and the initial velocity in ENU."""
    if recording.velocity is None or recording.velocity.frame == "enu":
        return build_timeline(recording, attitude)
    as_measured = replace(recording, velocity=replace(recording.velocity, frame="enu"))  # prevents a rotation to ENU
    timeline = build_timeline(as_measured, attitude)
    in_enu = build_timeline(recording, attitude)
    return replace(timeline, x0=in_enu.x0, P0=in_enu.P0)


def _velocity_frame(recording: Recording) -> str:
    return "enu" if recording.velocity is None else recording.velocity.frame
