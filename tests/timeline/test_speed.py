"""A wheel's speed, along the body's x axis, as rows of an ENU velocity."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jerkbench.estimate import Attitude
from jerkbench.recording import Velocity
from jerkbench.timeline import INITIAL_SPEED_SIGMA_MPS, INPUT_SIGMA_MPS2, build_timeline, velocity_in_enu
from synthetic import level_attitude, recording_at_rest

YAW, PITCH, ROLL = 2.0, -0.2, 0.1
COURSE = np.array([np.cos(YAW) * np.cos(PITCH), np.sin(YAW) * np.cos(PITCH), -np.sin(PITCH)])


def slanted():
    """The attitude, at two stamps, of a body that looks along COURSE from 1 s on."""
    turn = Rotation.from_euler("ZYX", [YAW, PITCH, ROLL]).as_matrix()
    euler = np.array([[0.0, 0.0, 0.0], [ROLL, PITCH, YAW]])
    return Attitude(np.array([0.0, 1.0]), np.stack([np.eye(3), turn]), euler, np.zeros((2, 3)), np.zeros(2, dtype=bool))


def test_it_stands_along_the_course_of_its_time():
    speed = Velocity.along_course([0.5, 1.5], [3.0, -2.0], 0.5)

    np.testing.assert_allclose(velocity_in_enu(speed, slanted()).mps, [[3.0, 0.0, 0.0], -2.0 * COURSE], atol=1e-12)


def test_a_speed_alone_updates_a_filter_as_one_row_along_the_course():
    velocity = velocity_in_enu(Velocity.along_course([1.5], [3.0], 0.5), slanted())
    root = np.random.default_rng(0).normal(size=(3, 3))
    P, v = root @ root.T, np.array([1.0, -2.0, 0.5])
    gain = P @ COURSE / (COURSE @ P @ COURSE + 0.25)
    of_one = v + gain * (3.0 - COURSE @ v), P - np.outer(gain, COURSE @ P)
    K = P @ np.linalg.inv(P + velocity.covariance_m2ps2[0])

    np.testing.assert_allclose(v + K @ (velocity.mps[0] - v), of_one[0], atol=2e-3)
    np.testing.assert_allclose(P - K @ P, of_one[1], atol=2e-3)


def test_what_does_not_slide_has_its_own_sigma_across():
    velocity = velocity_in_enu(Velocity.along_course([1.5], [3.0], 0.5, across_sigma_mps=0.1), slanted())
    across = np.eye(3) - np.outer(COURSE, COURSE)

    np.testing.assert_allclose(velocity.covariance_m2ps2[0], 0.25 * np.outer(COURSE, COURSE) + 0.01 * across)


def test_a_true_covariance_is_turned_too_and_an_absent_row_stays_absent():
    covariance = np.tile(np.diag([0.25, np.nan, np.nan]), (2, 1, 1))
    true = np.tile(np.diag([4.0, np.nan, np.nan]), (2, 1, 1))
    speed = Velocity([1.2, 1.5], [[3.0, np.nan, np.nan], 3 * [np.nan]], covariance, "speed", true)
    velocity = velocity_in_enu(speed, slanted())

    assert COURSE @ velocity.true_covariance_m2ps2[0] @ COURSE == pytest.approx(4.0)
    assert np.isnan(velocity.mps[1]).all()


def test_a_run_starts_along_the_course_and_knows_no_less_across_than_without_a_speed():
    recording = recording_at_rest(duration_s=1.0, velocity=Velocity.along_course([0.1, 0.3], [3.0, 3.0], 0.5))
    timeline = build_timeline(recording, level_attitude(recording))  # the first fix is at .2 s

    np.testing.assert_allclose(timeline.x0[3:], [3.0, 0.0, 0.0])
    np.testing.assert_allclose(
        np.diag(timeline.P0)[3:], [0.25 + (0.1 * INPUT_SIGMA_MPS2) ** 2, *2 * [INITIAL_SPEED_SIGMA_MPS**2]]
    )
