"""Alignment, the first yaw, stillness and the order of the events."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jerkbench.errors import RecordingError
from jerkbench.geometry import roll_pitch
from jerkbench.inertial.run_inputs import (
    LEVELLING_S,
    MOVING_TILT_RAD,
    StartSigmas,
    align,
    merge_events,
    still_samples,
)
from jerkbench.inertial.state import SensorNoise
from jerkbench.recording import GRAVITY_MPS2, Heading, Imu, Position
from jerkbench.timeline import build_timeline
from synthetic import level_attitude, recording_at_rest

NOISE = SensorNoise(angle=4e-6, velocity=9e-4, gyro_bias=0.0, accel_bias=0.0)
SIGMAS = StartSigmas(gyro_bias_radps=0.01, accel_bias_mps2=0.1, yaw_rad=0.3, still_mps=0.02)


def tilted(roll, pitch, gyro=(0.0, 0.0, 0.0), static_start_s=2.0):
    rest = recording_at_rest(duration_s=5.0, static_start_s=static_start_s)
    force = Rotation.from_euler("ZYX", [0.7, pitch, roll]).as_matrix().T @ [0, 0, GRAVITY_MPS2]
    n = len(rest.imu.t_s)
    return replace(rest, imu=Imu(rest.imu.t_s, np.tile(force, (n, 1)), np.tile(gyro, (n, 1))))


def steps_of(timeline):
    return timeline.t_s, timeline.update, timeline.reference


def start_of(recording, yaw=0.7, *, from_rest=True, sigmas=SIGMAS):
    attitude = level_attitude(recording)
    timeline = build_timeline(recording, attitude)
    return align(recording, attitude, timeline, yaw, sigmas, NOISE, gyro_bias_from_rest=from_rest)


def test_at_rest_it_is_levelled_and_the_gyro_shows_its_bias():
    state, P = start_of(tilted(0.1, -0.2, gyro=(0.01, 0.02, -0.03)))

    np.testing.assert_allclose(state.dcm, Rotation.from_euler("ZYX", [0.7, -0.2, 0.1]).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(state.gyro_bias_radps, [0.01, 0.02, -0.03])
    np.testing.assert_allclose(np.diag(P)[9:12], 4e-6 / 2.0)
    np.testing.assert_allclose(np.diag(P)[3:6], 0.02**2)
    np.testing.assert_array_equal(state.velocity_mps, 0.0)
    assert P[8, 8] == pytest.approx(0.09)
    assert np.linalg.eigvalsh(P).min() > 0


def test_without_the_rest_the_gyro_bias_is_unknown():
    state, P = start_of(tilted(0.0, 0.0, gyro=(0.01, 0.0, 0.0)), from_rest=False)

    np.testing.assert_array_equal(state.gyro_bias_radps, 0.0)
    np.testing.assert_allclose(np.diag(P)[9:12], 1e-4)


def levelled(recording, imu):
    return roll_pitch(replace(recording, imu=imu).apparent_vertical(LEVELLING_S))


def test_the_tilt_that_an_accelerometer_bias_makes_is_in_the_covariance():
    recording = tilted(0.1, -0.2)
    _, P = start_of(recording)
    true = Rotation.from_euler("ZYX", [0.7, -0.2, 0.1]).as_matrix()
    J = np.empty((3, 3))
    for axis, bias in enumerate(1e-4 * np.eye(3)):
        biased = replace(recording.imu, accel_mps2=recording.imu.accel_mps2 + bias)
        roll, pitch = levelled(recording, biased)
        wrong = Rotation.from_euler("ZYX", [0.7, pitch, roll]).as_matrix()
        J[:, axis] = Rotation.from_matrix(true @ wrong.T).as_rotvec() / 1e-4
    noise = 9e-4 / GRAVITY_MPS2**2

    # turning about the vertical is left out: yaw is given
    np.testing.assert_allclose(P[6:8, 12:], 0.01 * J[:2], atol=1e-7)
    np.testing.assert_allclose(P[6:8, 6:8], 0.01 * J[:2] @ J[:2].T + noise * np.eye(2), atol=1e-7)


def test_moving_it_starts_with_the_attitude_and_the_velocity_that_are_given():
    recording = tilted(0.1, -0.2, static_start_s=0.0)
    moving = replace(recording.velocity, mps=recording.velocity.mps + np.array([1.0, 2.0, 3.0]))
    state, P = start_of(replace(recording, velocity=moving))

    np.testing.assert_allclose(state.dcm, Rotation.from_euler("Z", 0.7).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(state.velocity_mps, [1.0, 2.0, 3.0])
    np.testing.assert_allclose(np.diag(P)[6:8], MOVING_TILT_RAD**2)
    np.testing.assert_allclose(np.diag(P)[3:6], 0.03**2)


def test_a_start_after_the_rest_is_moving():
    recording = tilted(0.1, -0.2)
    late = recording.position.t_s > 3.0
    p = recording.position
    state, _ = start_of(replace(recording, position=Position(p.t_s[late], p.enu_m[late], p.covariance_m2[late])))

    np.testing.assert_allclose(state.dcm, Rotation.from_euler("Z", 0.7).as_matrix(), atol=1e-12)


def test_an_accelerometer_without_gravity_is_a_sentence():
    recording = recording_at_rest(duration_s=3.0, static_start_s=2.0)
    imu = replace(recording.imu, accel_mps2=np.zeros_like(recording.imu.accel_mps2))

    with pytest.raises(RecordingError, match="must contain gravity"):
        start_of(replace(recording, imu=imu))


@pytest.mark.parametrize(("sensor", "column"), [("accel_mps2", 0), ("gyro_radps", 2)])
def test_it_stands_still_where_both_sensors_are_quiet(sensor, column):
    imu = recording_at_rest(duration_s=10.0).imu
    shaken = getattr(imu, sensor).copy()
    shaken[400:500, column] += np.sin(np.arange(100.0))
    still = still_samples(replace(imu, **{sensor: shaken}), 1.0, 0.1, 0.05)

    assert still[99:400].all()
    assert not still[:99].any()
    assert not still[405:590].any()
    assert still[600:].all()


def test_headings_split_the_steps_and_keep_everything_else():
    recording = recording_at_rest(duration_s=2.0, imu_rate_hz=10, gnss_rate_hz=2)
    t_s = np.array([0.1, 0.75, 1.0, 1.25, 5.0])  # before the start, between, on a fix, between, after the end
    headings = Heading(t_s, np.zeros(5), np.full(5, 0.1))
    timeline = build_timeline(recording, level_attitude(recording))
    plain, events = (merge_events(*steps_of(timeline), recording.imu, h, 0.5) for h in (None, headings))

    np.testing.assert_array_equal(plain.t_s, timeline.t_s)
    np.testing.assert_array_equal(plain.sample, timeline.sample)
    np.testing.assert_allclose(plain.dt_s, timeline.dt_s)
    np.testing.assert_array_equal(events.heading[events.heading >= 0], [1, 2, 3])
    np.testing.assert_allclose(events.t_s[events.heading >= 0], [0.75, 1.0, 1.25])
    np.testing.assert_array_equal(events.update[events.update >= 0], timeline.update[timeline.update >= 0])
    np.testing.assert_array_equal(events.reference[events.reference >= 0], timeline.reference[timeline.reference >= 0])
    np.testing.assert_allclose(events.dt_s, np.diff(events.t_s, prepend=0.5), atol=1e-12)
    assert recording.imu.t_s[events.sample[events.heading == 1]] == pytest.approx(0.8)
