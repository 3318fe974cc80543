"""The inputs of an inertial run as the parameters ask for them: measurements, start, settings."""

from dataclasses import replace

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.attitude.common import filtered_yaw
from jerkbench.attitude.yaw import required_track
from jerkbench.errors import RecordingError
from jerkbench.estimate import Attitude
from jerkbench.filters._eskf15_parameters import DEG_PER_H, MG, Eskf15Parameters
from jerkbench.inertial.alignment import StartSigmas, align, with_body_velocity
from jerkbench.inertial.mechanisation import earth_at
from jerkbench.inertial.run_inputs import Constraints, Journey, Settings, merge_events, still_samples
from jerkbench.inertial.state import NavigationState
from jerkbench.recording import Recording
from jerkbench.timeline import Timeline, build_timeline

YAW_WALK = 2e-4
"""Random walk of the yaw of the track [rad/sqrt(s)]; the attitude filters' own default."""

COURSE_SIGMA_RAD = 0.0087
"""Least sigma of a course of the track; the attitude filters' own default."""


def run_inputs(parameters: Eskf15Parameters, recording: Recording, attitude: Attitude) -> Journey:
    """Return everything that a run needs besides its adaptation."""
    recording = aided(parameters, recording)
    timeline = _timeline(recording, attitude)
    headings = recording.heading if parameters.use_heading else None
    events = merge_events(timeline, recording.inertial, headings, parameters.constraint_interval_s)
    start = _start(parameters, recording, attitude, timeline)
    return Journey(recording.inertial, timeline, headings, events, start, _settings(parameters, recording))


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
        accel_bias_mps2=parameters.accel_turn_on_mg * MG,
        yaw_rad=max(parameters.initial_yaw_sigma_rad, yaw_sigma_rad),
        still_mps=parameters.zero_velocity_sigma_mps,
        gyro_scale=parameters.gyro_scale_ppm * 1e-6,
        accel_scale=parameters.accel_scale_ppm * 1e-6,
        misalignment_rad=parameters.misalignment_mrad * 1e-3,
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
        yaw = filtered_yaw(recording.inertial, roll, pitch, track, YAW_WALK, COURSE_SIGMA_RAD)
        return float(yaw.rad[sample]), float(yaw.sigma_rad[sample])
    known = attitude.yaw_sigma_rad
    return float(attitude.euler_rad[sample, 2]), 0.0 if known is None else float(known[sample])


def _settings(parameters: Eskf15Parameters, recording: Recording) -> Settings:
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
    return Settings(
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
    timeline = build_timeline(_as_measured(recording), attitude)
    if _velocity_frame(recording) == "enu":
        return timeline
    turned = build_timeline(recording, attitude)
    return replace(timeline, x0=turned.x0, P0=turned.P0)


def _velocity_frame(recording: Recording) -> str:
    return "enu" if recording.velocity is None else recording.velocity.frame


def _as_measured(recording: Recording) -> Recording:
    """The recording with its velocity taken as it is: this filter turns one of the body with its own attitude."""
    if recording.velocity is None:
        return recording
    return replace(recording, velocity=replace(recording.velocity, frame="enu"))
