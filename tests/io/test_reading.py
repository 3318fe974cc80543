"""Small parts of the readers: files, lines, latencies, units and axes."""

import numpy as np
import pytest

from jerkbench.errors import RecordingError
from jerkbench.io.conversions import body_from_sensor, calibrated_at_rest, velocity_when_true
from jerkbench.io.files import find_file, read_lines
from jerkbench.io.sanitiser import steady_rows
from jerkbench.recording import Imu

T_S = np.array([10.0, 10.25, 10.5])
ENU = np.arange(9.0).reshape(3, 3)
COVARIANCE = np.tile(np.array([[4.0, 1.0, 0.5], [1.0, 5.0, 0.25], [0.5, 0.25, 6.0]]), (3, 1, 1))


@pytest.mark.parametrize("latency_s", [(0.125, 0.125, 0.275), (0.0, 0.1, 0.2), (0.0, 0.0, 0.25)])
def test_each_value_stands_once_at_its_own_time(latency_s):
    velocity = velocity_when_true(T_S, ENU, COVARIANCE, latency_s)
    found = {
        (round(t, 6), axis, row[axis])
        for t, row in zip(velocity.t_s, velocity.mps, strict=True)
        for axis in range(3)
        if np.isfinite(row[axis])
    }
    assert found == {(round(T_S[i] - latency_s[a], 6), a, ENU[i, a]) for i in range(3) for a in range(3)}
    for row, covariance in zip(velocity.mps, velocity.covariance_m2ps2, strict=True):
        for axis in np.flatnonzero(np.isfinite(row)):
            assert covariance[axis, axis] == COVARIANCE[0, axis, axis]


def test_cross_covariance_stays_between_axes_of_one_epoch_only():
    # up is one epoch old: its value meets east and north of the epoch before, with which it is not correlated
    velocity = velocity_when_true(T_S, ENU, COVARIANCE, (0.0, 0.0, 0.25))
    full = velocity.covariance_m2ps2[np.isfinite(velocity.mps).all(axis=1)]
    assert len(full) == 2
    np.testing.assert_array_equal(full[0], [[4, 1, 0], [1, 5, 0], [0, 0, 6]])


def test_none_several_and_missing_are_named(tmp_path):
    with pytest.raises(RecordingError, match="position_file"):
        find_file(tmp_path, "", ".pos", "position_file")
    (tmp_path / "a.pos").touch()
    (tmp_path / "b.pos").touch()
    with pytest.raises(RecordingError, match=r"contains 2 files that end in \.pos \(a\.pos, b\.pos\)"):
        find_file(tmp_path, "", ".pos", "position_file")
    with pytest.raises(RecordingError, match=r"c\.pos.*position_file"):
        find_file(tmp_path, "c.pos", ".pos", "position_file")
    with pytest.raises(RecordingError, match="There is no folder"):
        find_file(tmp_path / "gone", "", ".pos", "position_file")


def test_the_marks_of_events_beside_a_solution_are_not_the_solution(tmp_path):
    for name in ("a.pos", "a_events.pos"):
        (tmp_path / name).touch()
    assert find_file(tmp_path, "", ".pos", "position_file") == tmp_path / "a.pos"
    assert find_file(tmp_path, "a_events.pos", ".pos", "position_file") == tmp_path / "a_events.pos"


def test_fixes_that_all_leap_are_a_sentence():
    t_s = np.arange(5) * 0.1
    everywhere = 1e5 * np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1], [4, 3, -1], [-1, 4, 3]])
    with pytest.raises(RecordingError, match="all 5 fixes"):
        steady_rows("a.csv", t_s, everywhere, "enu")
    steady, notes = steady_rows("a.csv", t_s, 0 * everywhere, "enu")
    assert (steady.all(), notes) == (True, ())


SAMPLES_S = np.arange(400) * 0.01


def imu_at_rest(accel=(0.0, 6.0, 8.0), gyro=(0.01, -0.02, 0.03)):
    ripple = np.where(np.arange(400) % 2, 0.5, -0.5)[:, None]
    moving = (SAMPLES_S >= 2.0)[:, None]
    return Imu(SAMPLES_S, np.array(accel) + ripple + 5 * moving, np.array(gyro) + ripple + moving)


@pytest.mark.parametrize("accel", [(0.0, 0.0, 1.01), (0.0, 0.0, 96.0), (0.0, 0.0, 0.0)])
def test_a_wrong_unit_is_noticed(accel):
    with pytest.raises(RecordingError, match="correct the unit"):
        calibrated_at_rest(imu_at_rest(accel), 2.0, gyro=False, accel=True)


def test_the_body_sees_a_mounted_sensor_through_yaw_then_pitch_then_signs():
    yaw, pitch = np.radians([5.35, -6.79])
    cy, sy, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    yawed = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    pitched = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    expected = (yawed @ pitched).T @ np.diag([-1, -1, 1])
    np.testing.assert_allclose(body_from_sensor((-1.0, -1.0, 1.0), 5.35, -6.79), expected, atol=1e-15)


def written(tmp_path, content):
    path = tmp_path / "log.csv"
    path.write_bytes(content)
    return path


def test_long_files_of_short_lines_are_read(tmp_path):
    path = written(tmp_path, b"1,2\r\n" * 500_000)
    assert len(read_lines(path)) == 500_000
