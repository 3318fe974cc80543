"""Trajectories in the forms in which the field writes them, against motions that are written down here."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from pymap3d import enu2geodetic
from scipy.spatial.transform import Rotation

from jerkbench.errors import RecordingError
from jerkbench.io.trajectory import TrajectoryForm, estimate_at_reference, read_trajectory
from jerkbench.plugins.samples import small_recording

START, SPEED = np.array([10.0, -5.0, 2.0]), np.array([1.0, 2.0, -0.1])
EULER = np.array([0.1, -0.2, 0.7])


@pytest.fixture(scope="module")
def recording():
    return replace(small_recording(), start_utc=datetime(2024, 5, 14, 14, 0, 0, 250_000, tzinfo=UTC))


def moving(recording, every=1):
    """Stamps from 0 to the end, and the place at each: a straight line."""
    t_s = np.concatenate([[0.0], recording.reference.t_s[::every], recording.reference.t_s[-1:] + 0.01])
    return t_s, START + t_s[:, None] * SPEED


def table(path, names, columns):
    path.write_text("\n".join([",".join(names), *(",".join(map(repr, map(float, row))) for row in columns)]) + "\n")
    return path


def scored(path, recording, **form):
    given = TrajectoryForm(**form)
    return estimate_at_reference(read_trajectory(path, given, recording), recording, given.max_gap_s)


def at_reference(recording):
    return START + recording.reference.t_s[:, None] * SPEED


def test_a_sample_at_the_stamp_is_taken_to_the_bit(tmp_path, recording):
    t_s = recording.reference.t_s
    places = np.random.default_rng(1).normal(size=(len(t_s), 3))
    file = table(tmp_path / "a.csv", ["t_s", "east_m", "north_m", "up_m"], np.column_stack([t_s, places]))

    estimate = scored(file, recording)

    np.testing.assert_array_equal(estimate.position_m, places)
    assert estimate.position_only
    assert np.isnan(estimate.velocity_mps).all()


def test_seconds_since_1970_and_since_the_start_are_told_apart(tmp_path, recording):
    t_s, places = moving(recording)
    absolute_ns = round(recording.start_utc.timestamp() * 1e6) * 1000 + np.round(t_s * 1e9).astype(int)
    for name, stamps in (
        ("a", [f"{ns // 10**9}.{ns % 10**9:09d}" for ns in absolute_ns]),
        ("b", map(repr, t_s.tolist())),
    ):
        lines = [f"{t} {x} {y} {z} 0 0 0 1" for t, (x, y, z) in zip(stamps, places.tolist(), strict=True)]
        (tmp_path / f"{name}.tum").write_text("\n".join(["# t x y z qx qy qz qw", *lines]))
        estimate = scored(tmp_path / f"{name}.tum", recording)
        np.testing.assert_allclose(estimate.position_m, at_reference(recording), atol=1e-9)
        assert np.isnan(estimate.euler_rad).all()  # nothing but the identity: TUM cannot leave a rotation out


def test_a_rotation_of_tum_is_that_of_the_body_in_enu(tmp_path, recording):
    t_s, places = moving(recording)
    q = Rotation.from_euler("ZYX", EULER[::-1]).as_quat()
    np.savetxt(tmp_path / "a.tum", np.column_stack([t_s, places, np.tile(q, (len(t_s), 1))]), fmt="%.15g")

    estimate = scored(tmp_path / "a.tum", recording)

    np.testing.assert_allclose(estimate.euler_rad, np.tile(EULER, (len(estimate.index), 1)), atol=1e-12)


@pytest.mark.parametrize("week", [1, 0])  # KF-GINS writes 0
def test_the_result_of_kf_gins_is_geodetic_ned_and_frd(tmp_path, recording, week):
    t_s, places = moving(recording)
    origin = recording.origin
    where = enu2geodetic(*places.T, origin.latitude_deg, origin.longitude_deg, origin.height_m)
    ned = np.tile([SPEED[1], SPEED[0], -SPEED[2]], (len(t_s), 1))
    enu_of_ned, flu_of_frd = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]), np.diag([1, -1, -1])
    turn = enu_of_ned.T @ Rotation.from_euler("ZYX", EULER[::-1]).as_matrix() @ flu_of_frd
    rph = np.tile(Rotation.from_matrix(turn).as_euler("ZYX", degrees=True)[::-1], (len(t_s), 1))
    gps_s = recording.start_utc.timestamp() - 315964800 + 18 + t_s  # GPS time is 18 s ahead
    columns = [week * (gps_s // 604800), gps_s % 604800, *where, *ned.T, *rph.T]
    np.savetxt(tmp_path / "KF_GINS_Navresult.nav", np.column_stack(columns), fmt="%.12f")

    estimate = scored(tmp_path / "KF_GINS_Navresult.nav", recording)

    np.testing.assert_allclose(estimate.position_m, at_reference(recording), atol=2e-6)
    np.testing.assert_allclose(estimate.velocity_mps, np.tile(SPEED, (len(estimate.index), 1)), atol=1e-9)
    np.testing.assert_allclose(estimate.euler_rad, np.tile(EULER, (len(estimate.index), 1)), atol=1e-9)


def test_ned_is_turned_with_its_covariance(tmp_path, recording):
    t_s, places = moving(recording)
    A = np.random.default_rng(2).normal(size=(6, 6))
    P = A @ A.T
    swap = np.kron(np.eye(2), np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]]))
    upper = P[np.triu_indices(6)]
    names = [f"P{i}{j}" for i in range(1, 7) for j in range(i, 7)]
    columns = [t_s, places[:, 1], places[:, 0], -places[:, 2], *np.tile(upper, (len(t_s), 1)).T]
    file = table(tmp_path / "a.csv", ["t_s", "north_m", "east_m", "down_m", *names], np.column_stack(columns))

    estimate = scored(file, recording, frame="ned")

    np.testing.assert_allclose(estimate.position_m, at_reference(recording), atol=1e-9)
    np.testing.assert_allclose(estimate.covariance[7], swap @ P @ swap.T, atol=1e-12)


def test_variances_of_the_position_alone_leave_the_rest_unknown(tmp_path, recording):
    t_s, places = moving(recording)
    rows = np.column_stack([t_s, places, np.tile([1.0, 4.0, 9.0], (len(t_s), 1))])
    file = table(tmp_path / "a.csv", ["t", "x", "y", "z", "a", "b", "c"], rows)

    estimate = scored(file, recording, time="t", position=("x", "y", "z"), covariance=("a", "b", "c"))

    np.testing.assert_array_equal(estimate.covariance[0, :3, :3], np.diag([1.0, 4.0, 9.0]))
    assert np.isnan(estimate.covariance[0, 3:]).all()


def test_between_two_samples_it_is_a_straight_line_and_the_shortest_turn(tmp_path, recording):
    t_s, places = moving(recording, every=3)
    yaw = 3.0 + 0.05 * t_s  # over the edge of (-pi, pi]
    angles = np.column_stack([np.zeros(len(t_s)), np.zeros(len(t_s)), (yaw + np.pi) % (2 * np.pi) - np.pi])
    names = ["t_s", "east_m", "north_m", "up_m", "roll_rad", "pitch_rad", "yaw_rad"]
    file = table(tmp_path / "a.csv", names, np.column_stack([t_s, places, angles]))

    estimate = scored(file, recording)

    np.testing.assert_allclose(estimate.position_m, at_reference(recording), atol=1e-9)
    wanted = 3.0 + 0.05 * recording.reference.t_s
    np.testing.assert_allclose(np.exp(1j * estimate.euler_rad[:, 2]), np.exp(1j * wanted), atol=1e-9)


def test_an_early_end_is_a_run_that_stopped(tmp_path, recording):
    t_s, places = moving(recording)
    file = table(tmp_path / "a.csv", ["t_s", "east_m", "north_m", "up_m"], np.column_stack([t_s, places])[t_s < 10.0])

    estimate = scored(file, recording)

    assert estimate.failure.startswith("The trajectory ends at 9.9")
    assert recording.reference.t_s[estimate.index[-1]] < 10.0


def without(rows, begin, end):
    return rows[(rows[:, 0] < begin) | (rows[:, 0] > end)]


def with_value(rows, row, column, value):
    changed = rows.copy()
    changed[row, column] = value
    return changed


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda rows: without(rows, 5.0, 6.0), r"has no estimate between 4\.98 and 6\.02 s"),
        (lambda rows: with_value(rows, 4, 2, np.nan), r"row 5: the position \(north_m\) is no finite number"),
        (lambda rows: with_value(rows, 4, 1, np.inf), "row 5"),
        (lambda rows: with_value(rows, 4, 0, 0.0), "row 5: its time is not after that of the row above"),
        (lambda rows: rows[:0], "no estimate in it"),
    ],
)
def test_what_cannot_be_scored_is_a_sentence(tmp_path, recording, spoil, sentence):
    rows = spoil(np.column_stack(moving(recording)))
    file = table(tmp_path / "a.csv", ["t_s", "east_m", "north_m", "up_m"], rows)

    with pytest.raises(RecordingError, match=sentence):
        scored(file, recording)


def test_no_file_is_a_sentence(tmp_path, recording):
    with pytest.raises(RecordingError, match="There is no trajectory"):
        scored(tmp_path / "a.tum", recording)
