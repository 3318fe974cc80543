"""The order of measurements and events, and speeds without a direction."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jerkbench.errors import RecordingError
from jerkbench.estimate import Attitude
from jerkbench.recording import Position, Reference, Velocity
from jerkbench.timeline import INITIAL_SPEED_SIGMA_MPS, INPUT_SIGMA_MPS2, build_timeline, velocity_in_enu
from synthetic import level_attitude, recording_at_rest

COVARIANCE = 0.01 * np.eye(3)


def positions(t_s, enu_m=None):
    n = len(t_s)
    return Position(t_s, np.zeros((n, 3)) if enu_m is None else enu_m, np.tile(COVARIANCE, (n, 1, 1)))


def velocities(t_s, mps):
    return Velocity(t_s, mps, np.tile(COVARIANCE, (len(t_s), 1, 1)))


def timeline_of(**replaced):
    recording = recording_at_rest(duration_s=1.0, **replaced)
    return build_timeline(recording, level_attitude(recording))


def test_measurements_split_the_intervals_and_the_steps_add_up():
    timeline = timeline_of(position=positions([0.1, 0.505]), velocity=None)
    at = int(np.flatnonzero(timeline.update >= 0)[0])
    assert timeline.t_s[at] == pytest.approx(0.505, abs=1e-12)
    np.testing.assert_allclose(timeline.dt_s[at : at + 2], [0.005, 0.005], atol=1e-12)
    assert timeline.sample[at] == timeline.sample[at + 1] == 50  # the sample that ends at 0.51 s
    timeline = timeline_of(position=positions([0.1237, 0.3333, 0.7]), velocity=None)
    assert timeline.dt_s[0] == 0.0
    assert timeline.dt_s.sum() == pytest.approx(1.0 - 0.1237, abs=1e-12)
    np.testing.assert_allclose(np.cumsum(timeline.dt_s) + 0.1237, timeline.t_s, atol=1e-9)
    timeline = timeline_of(position=positions([0.1, 0.1 + 0.2]), velocity=None)  # 0.30000000000000004
    assert timeline.dt_s[1:].min() > 0.009


def test_position_and_velocity_at_the_same_time_are_one_update_and_else_two():
    timeline = timeline_of(
        position=positions([0.1, 0.5, 0.8]), velocity=velocities([0.5, 0.7], [[1.0, np.nan, np.nan], [2.0, 3.0, 4.0]])
    )
    rows = [np.flatnonzero(np.isfinite(z)).tolist() for z in timeline.measurements.z]

    assert rows == [[0, 1, 2], [0, 1, 2, 3], [3, 4, 5], [0, 1, 2]]
    assert timeline.update[timeline.update >= 0].tolist() == [1, 2, 3]


def test_the_reference_is_met_at_its_own_stamps():
    stamps = np.array([0.05, 0.4567, 0.99])
    timeline = timeline_of(
        position=positions([0.1]),
        velocity=None,
        reference=Reference(stamps, "made by hand", independent=True, enu_m=np.zeros((3, 3))),
    )
    met = timeline.reference >= 0

    assert timeline.reference[met].tolist() == [1, 2]  # the first one is before the first fix
    np.testing.assert_allclose(timeline.t_s[met], stamps[1:], atol=1e-12)


def start_with(t_s, mps, fix_at=0.5):
    """The start of a run whose first fix is at 0.5 s, given what the velocity axes are when."""
    fixes = positions([fix_at, fix_at + 0.3], [[1.0, 2.0, 3.0], [0.0, 0.0, 0.0]])
    covariance = np.array([(i + 1.0) * np.diag([1.0, 2.0, 3.0]) for i in range(len(t_s))])
    return timeline_of(position=fixes, velocity=Velocity(t_s, mps, covariance))


def test_it_starts_at_the_first_fix_with_the_latest_velocity_of_each_axis():
    timeline = start_with([0.5], [[7.0, 8.0, 9.0]])
    np.testing.assert_array_equal(timeline.x0, [1.0, 2.0, 3.0, 7.0, 8.0, 9.0])
    np.testing.assert_array_equal(np.diag(timeline.P0), [0.01, 0.01, 0.01, 1.0, 2.0, 3.0])
    assert timeline.update[0] == -1
    assert timeline.update[timeline.update >= 0].tolist() == [1]  # the fix at 0.8 s
    nan = np.nan
    timeline = start_with([0.1, 0.3, 0.5], [[1.0, 2.0, 3.0], [4.0, 5.0, nan], [6.0, nan, nan]])
    np.testing.assert_array_equal(timeline.x0[3:], [6.0, 5.0, 3.0])
    grown = [0.0, (0.2 * INPUT_SIGMA_MPS2) ** 2, (0.4 * INPUT_SIGMA_MPS2) ** 2]  # .2 and .4 s old
    np.testing.assert_allclose(np.diag(timeline.P0)[3:], np.array([3.0 * 1.0, 2.0 * 2.0, 1.0 * 3.0]) + grown)
    timeline = start_with([0.2, 0.501], [[7.0, np.nan, np.nan], [8.0, 9.0, np.nan]])
    np.testing.assert_array_equal(timeline.x0[3:], [7.0, 0.0, 0.0])
    np.testing.assert_allclose(
        np.diag(timeline.P0)[3:],
        [1.0 + (0.3 * INPUT_SIGMA_MPS2) ** 2, INITIAL_SPEED_SIGMA_MPS**2, INITIAL_SPEED_SIGMA_MPS**2],
    )
    updates = timeline.measurements.z[timeline.update[timeline.update >= 0]]
    np.testing.assert_array_equal(updates[0, 3:], [8.0, 9.0, np.nan])


@pytest.mark.parametrize(("age_s", "used"), [(1.0, True), (1.001, False)])
def test_a_velocity_of_more_than_a_second_ago_is_too_old_to_start_from(age_s, used):
    recording = recording_at_rest(
        duration_s=3.0, position=positions([2.0]), velocity=velocities([2.0 - age_s], [[1.0, 2.0, 3.0]])
    )
    timeline = build_timeline(recording, level_attitude(recording))

    np.testing.assert_array_equal(timeline.x0[3:], [1.0, 2.0, 3.0] if used else np.zeros(3))


def test_variances_below_a_millimetre_are_raised_and_a_missing_fix_is_a_sentence():
    covariance = np.tile([[1e-9, 1e-7, 0.0], [1e-7, 1.0, 0.0], [0.0, 0.0, 1.0]], (1, 1, 1))
    timeline = timeline_of(position=Position([0.1], np.zeros((1, 3)), covariance), velocity=None)
    assert timeline.measurements.R[0, 0, 0] == 1e-6
    assert timeline.measurements.R[0, 0, 1] == 1e-7
    with pytest.raises(RecordingError, match="rest has no position fix with all three axes"):
        timeline_of(position=None)


def test_a_body_velocity_is_turned_with_the_attitude_of_its_time():
    recording = recording_at_rest(
        duration_s=1.0, velocity=Velocity([0.5], [[1.0, 0.0, 0.0]], np.diag([1.0, 4.0, 9.0])[None], frame="body")
    )
    attitude = level_attitude(recording)
    quarter_turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # heading north
    attitude.dcm[49:] = quarter_turn  # from 0.5 s on
    z = build_timeline(recording, attitude).measurements
    at = int(np.flatnonzero(np.isfinite(z.z[:, 3]))[0])

    np.testing.assert_allclose(z.z[at, 3:], [0.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(np.diag(z.R[at])[3:], [4.0, 1.0, 9.0], atol=1e-12)


YAW, PITCH, ROLL = 2.0, -0.2, 0.1
COURSE = np.array([np.cos(YAW) * np.cos(PITCH), np.sin(YAW) * np.cos(PITCH), -np.sin(PITCH)])


def slanted():
    """The attitude, at two stamps, of a body that looks along COURSE from 1 s on."""
    turn = Rotation.from_euler("ZYX", [YAW, PITCH, ROLL]).as_matrix()
    euler = np.array([[0.0, 0.0, 0.0], [ROLL, PITCH, YAW]])
    return Attitude(np.array([0.0, 1.0]), np.stack([np.eye(3), turn]), euler, np.zeros((2, 3)), np.zeros(2, dtype=bool))


def test_a_speed_stands_along_the_course_of_its_time_with_its_own_sigma_across():
    speed = Velocity.along_course([0.5, 1.5], [3.0, -2.0], 0.5)
    np.testing.assert_allclose(velocity_in_enu(speed, slanted()).mps, [[3.0, 0.0, 0.0], -2.0 * COURSE], atol=1e-12)
    velocity = velocity_in_enu(Velocity.along_course([1.5], [3.0], 0.5, across_sigma_mps=0.1), slanted())
    across = np.eye(3) - np.outer(COURSE, COURSE)
    np.testing.assert_allclose(velocity.covariance_m2ps2[0], 0.25 * np.outer(COURSE, COURSE) + 0.01 * across)
    covariance = np.tile(np.diag([0.25, np.nan, np.nan]), (2, 1, 1))
    true = np.tile(np.diag([4.0, np.nan, np.nan]), (2, 1, 1))
    speed = Velocity([1.2, 1.5], [[3.0, np.nan, np.nan], 3 * [np.nan]], covariance, "speed", true)
    velocity = velocity_in_enu(speed, slanted())
    assert COURSE @ velocity.true_covariance_m2ps2[0] @ COURSE == pytest.approx(4.0)
    assert np.isnan(velocity.mps[1]).all()


def test_a_speed_alone_updates_a_filter_as_one_row_along_the_course():
    velocity = velocity_in_enu(Velocity.along_course([1.5], [3.0], 0.5), slanted())
    root = np.random.default_rng(0).normal(size=(3, 3))
    P, v = root @ root.T, np.array([1.0, -2.0, 0.5])
    gain = P @ COURSE / (COURSE @ P @ COURSE + 0.25)
    of_one = v + gain * (3.0 - COURSE @ v), P - np.outer(gain, COURSE @ P)
    K = P @ np.linalg.inv(P + velocity.covariance_m2ps2[0])

    np.testing.assert_allclose(v + K @ (velocity.mps[0] - v), of_one[0], atol=2e-3)
    np.testing.assert_allclose(P - K @ P, of_one[1], atol=2e-3)
