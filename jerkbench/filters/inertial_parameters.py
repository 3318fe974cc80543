"""The parameters of the inertial filters, and what they need of a recording before the first step."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import FloatArray, Same
from jerkbench.attitude.yaw import estimate_yaw, required_track
from jerkbench.errors import PluginError, RecordingError, require_known
from jerkbench.estimate import Attitude
from jerkbench.inertial.mechanisation import SensorNoise, earth_at
from jerkbench.inertial.run_inputs import (
    Constraints,
    Events,
    InertialSettings,
    Journey,
    StartSigmas,
    align,
    merge_events,
    still_samples,
    with_body_velocity,
)
from jerkbench.inertial.state import NavigationState
from jerkbench.parameters import DefaultOrigin, Limit, Limited, Range
from jerkbench.recording import GRAVITY_MPS2, Heading, Imu, Recording
from jerkbench.timeline import Timeline, build_timeline

INERTIAL_YAW_SOURCES = ("attitude", "track")

DEG_PER_H = np.deg2rad(1.0) / 3600.0
PER_SQRT_H = 1.0 / 60.0
_MG = 1e-3 * GRAVITY_MPS2

_GRADES = "ours: from a tactical sensor to a phone's on a vibrating vehicle"

OF_FIELD = DefaultOrigin("data sheet: the simulated field's IMU, 0.0017 rad/s and 0.02 m/s2 a sample at 100 Hz")
INDUSTRIAL = DefaultOrigin("ours, of the order of an industrial MEMS module")

POSITIVE_SIGMA = Limit(lambda value: 0 < value < math.inf, "it must be positive.")
MORE_THAN_0 = Limit(lambda value: value > 0, "it must be positive.")
MAY_BE_OFF = Limit(lambda value: 0 <= value < math.inf, "it must be 0 (constant) or more.")
OF_THREE = Limit(lambda arm: len(arm) == 3, "give three: forward, left, up.")


@dataclass(frozen=True)
class Eskf15Parameters(Limited):
    """The parameters of `eskf15`, and of the filters that are made of its parts.

    Attributes:
        angle_random_walk_deg_per_sqrt_h: white noise of the gyro [deg/sqrt(h)].
        velocity_random_walk_mps_per_sqrt_h: white noise of the accelerometer [m/s/sqrt(h)].
        gyro_instability_deg_per_h: sigma of the wandering part of the gyro's bias; 0: it is constant [deg/h].
        gyro_correlation_s: tau of it [s].
        accel_instability_mg: sigma of the wandering part of the accelerometer's bias; 0: it is constant [mg].
        accel_correlation_s: tau of it [s].
        gyro_turn_on_deg_per_h: one sigma of the gyro's bias at the start [deg/h].
        accel_turn_on_mg: one sigma of the accelerometer's bias at the start [mg].
        gyro_bias_from_rest: whether the gyro's mean over the rest at the start is its first bias.
        yaw_source: first yaw, attitude (of the attitude filter) or track (of the fixes, whatever else there is).
        initial_yaw_sigma_rad: one sigma of the first yaw, where its source is no less sure itself [rad].
        track_least_m: how far apart two fixes have to be to show a course of the track [m].
        position_sigma_m: one sigma of each axis of a fix, in place of the reported covariance; null: as reported [m].
        antenna_m: lever arm from the IMU to the antenna, body: forward, left, up [m].
        use_velocity: whether the velocity is used.
        use_heading: whether a measured heading is used; one that is a course is taken for the body's.
        wheel_scale: whether the error of a wheel's scale is estimated; needs a velocity in the frame "speed".
        wheel_scale_sigma: one sigma of it at the start.
        zero_velocity: whether the vehicle is held when it stands still.
        zero_velocity_sigma_mps: one sigma of each axis then, and of the velocity at a start at rest [m/s].
        still_window_s: how long the IMU has to be still [s].
        still_accel_mps2: standard deviation of the accelerometer below which it is, three axes together [m/s2].
        still_gyro_radps: standard deviation of the gyro below which it is, three axes together [rad/s].
        still_below_mps: estimated speed below which it may be [m/s].
        nonholonomic: whether the vehicle does not move sideways and upwards.
        nonholonomic_sigma_mps: one sigma of each of the two [m/s].
        nonholonomic_point_m: where that holds, and where a wheel measures (rear axle), from the IMU, body [m].
        constraint_interval_s: time between two zero-velocity or non-holonomic updates [s].
        reference_point_m: the point whose position and velocity are given out, from the IMU, body [m].
        earth_rotation: whether the Earth's rotation is taken into account; needs the recording's origin, and a gyro
            from which the mean at rest was not taken.
        earth_curvature: whether gravity turns with the position.
    """

    title: ClassVar[str]
    invariant: ClassVar[bool]
    not_taken: ClassVar[tuple[str, ...]] = ()
    """Parameters of `eskf15` that a filter made of its parts has no use for."""

    angle_random_walk_deg_per_sqrt_h: Annotated[
        float,
        POSITIVE_SIGMA,
        Range(0.01, 60.0, log=True, source=_GRADES),
        OF_FIELD,
    ] = 0.6
    velocity_random_walk_mps_per_sqrt_h: Annotated[
        float,
        POSITIVE_SIGMA,
        Range(0.005, 20.0, log=True, source=_GRADES),
        OF_FIELD,
    ] = 0.12
    gyro_instability_deg_per_h: Annotated[
        float,
        MAY_BE_OFF,
        Range(0.1, 500.0, log=True, source=_GRADES),
        INDUSTRIAL,
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
        """Check the limits and the source of the yaw, and that no parameter is given that the filter has no use for."""
        super().__post_init__()
        require_known(f"yaw_source of filter {self.title}", self.yaw_source, INERTIAL_YAW_SOURCES)
        for name in self.not_taken:
            if value := getattr(self, name):
                raise PluginError(
                    f"{self.title}.{name} is {value}; the filter {self.title} has none, set it to 0 or false."
                )

    def sensor_noise(self) -> SensorNoise:
        """Return the process noise in SI units."""
        gyro, accel = self.gyro_instability_deg_per_h * DEG_PER_H, self.accel_instability_mg * _MG
        return SensorNoise(
            angle=float(np.deg2rad(self.angle_random_walk_deg_per_sqrt_h) * PER_SQRT_H) ** 2,
            velocity=(self.velocity_random_walk_mps_per_sqrt_h * PER_SQRT_H) ** 2,
            gyro_bias=float(2.0 * gyro**2 / self.gyro_correlation_s),
            accel_bias=float(2.0 * accel**2 / self.accel_correlation_s),
        )


# The inputs of an inertial run as the parameters ask for them: measurements, start, settings.

YAW_WALK = 2e-4
"""Random walk of the yaw of the track [rad/sqrt(s)]; the attitude filters' own default."""

COURSE_SIGMA_RAD = 0.0087
"""Least sigma of a course of the track; the attitude filters' own default."""


def run_inputs(
    parameters: Eskf15Parameters, recording: Recording, attitude: Attitude, timeline: Timeline | None = None
) -> Journey:
    """Return everything that a run needs besides its adaptation.

    ``timeline`` is that of ``recording`` and ``attitude``, as `takes_timeline` says; None: it is made here.
    """
    recording = aided(parameters, recording)
    timeline = _timeline(recording, attitude) if timeline is None else timeline
    headings = recording.heading if parameters.use_heading else None
    steps = Same(timeline.t_s, timeline.update, timeline.reference)
    events = _events(steps, recording.inertial, headings, parameters.constraint_interval_s)
    start = _start(parameters, recording, attitude, timeline)
    return Journey(recording.inertial, timeline, headings, events, start, _settings(parameters, recording))


@lru_cache(maxsize=32)  # as many as a process keeps recordings
def _events(steps: Same, imu: Imu, headings: Heading | None, constraint_interval_s: float) -> Events:
    t_s, updates, references = steps.objects
    return merge_events(t_s, updates, references, imu, headings, constraint_interval_s)


def takes_timeline(parameters: Eskf15Parameters, recording: Recording) -> bool:
    """Whether a run takes the timeline of ``recording`` as it is, and looks at its covariances nowhere else."""
    as_it_is = aided(parameters, recording) is recording and _velocity_frame(recording) == "enu"
    return as_it_is and parameters.yaw_source != "track"


def aided(parameters: Eskf15Parameters, recording: Recording) -> Recording:
    """The recording with the measurements, and the fixes' covariance, that are asked for.

    Raises:
        RecordingError: the wheel's scale is asked for, and there is no wheel's speed.
    """
    if not parameters.use_velocity:
        recording = replace(recording, velocity=None)
    if parameters.wheel_scale and _velocity_frame(recording) != "speed":
        raise RecordingError(
            f"{recording.name}: {parameters.title}.wheel_scale needs a wheel's speed, and the velocity that is used is"
            f" {'none' if recording.velocity is None else recording.velocity.frame}; switch wheel_scale off."
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
    """First yaw and its sigma, as its source sees it; an attitude that says none is taken to be sure."""
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
        wheel_m=np.array(parameters.nonholonomic_point_m),
        constraints=constraints,
        invariant=parameters.invariant,
    )


def _timeline(recording: Recording, attitude: Attitude) -> Timeline:
    """The events with the velocity as it is measured, and the start with the velocity in ENU."""
    if recording.velocity is None or recording.velocity.frame == "enu":
        return build_timeline(recording, attitude)
    as_measured = replace(recording, velocity=replace(recording.velocity, frame="enu"))  # its own attitude turns it
    timeline = build_timeline(as_measured, attitude)
    turned = build_timeline(recording, attitude)
    return replace(timeline, x0=turned.x0, P0=turned.P0)


def _velocity_frame(recording: Recording) -> str:
    return "enu" if recording.velocity is None else recording.velocity.frame
