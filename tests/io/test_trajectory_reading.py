"""Trajectories in several formats, compared with known motions."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from pymap3d import enu2geodetic
from rosbags.rosbag1 import Writer
from scipy.spatial.transform import Rotation

from bag_maker import ROS1, odometry
from jerkbench.errors import RecordingError
from jerkbench.io.trajectory import (
    TrajectoryForm,
    estimate_at_reference,
    files_digest,
    pattern_of,
    read_trajectory,
    seeds_of,
)
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


def test_samples_at_the_stamps_are_taken_to_the_bit_and_an_early_end_is_a_run_that_stopped(tmp_path, recording):
    t_s = recording.reference.t_s
    places = np.random.default_rng(1).normal(size=(len(t_s), 3))
    file = table(tmp_path / "a.csv", ["t_s", "east_m", "north_m", "up_m"], np.column_stack([t_s, places]))
    estimate = scored(file, recording)
    np.testing.assert_array_equal(estimate.position_m, places)
    assert estimate.position_only
    assert np.isnan(estimate.velocity_mps).all()
    t_s, places = moving(recording)
    file = table(tmp_path / "a.csv", ["t_s", "east_m", "north_m", "up_m"], np.column_stack([t_s, places])[t_s < 10.0])
    estimate = scored(file, recording)
    assert estimate.failure.startswith("The trajectory ends at 9.9")
    assert recording.reference.t_s[estimate.index[-1]] < 10.0
    with pytest.raises(RecordingError, match=r"The trajectory .* does not exist"):
        scored(tmp_path / "a.tum", recording)


def test_tum_has_seconds_since_1970_or_the_start_and_rotations_of_the_body_in_enu(tmp_path, recording):
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


def test_covariances_are_turned_with_ned_and_may_be_of_the_position_alone(tmp_path, recording):
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


def with_value(rows, row, column, value):
    changed = rows.copy()
    changed[row, column] = value
    return changed


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (lambda rows: rows[(rows[:, 0] < 5.0) | (rows[:, 0] > 6.0)], r"has no estimate between 4\.98 and 6\.02 s"),
        (lambda rows: with_value(rows, 4, 2, np.nan), "row 5, column north_m: 'nan' is not a finite number"),
        (lambda rows: with_value(rows, 4, 1, np.inf), "row 5"),
        (lambda rows: with_value(rows, 4, 0, 0.0), "row 5: the time is not later than in the row above"),
        (lambda rows: rows[:0], "has no rows of data"),
    ],
)
def test_what_cannot_be_scored_is_a_sentence(tmp_path, recording, spoil, sentence):
    rows = spoil(np.column_stack(moving(recording)))
    file = table(tmp_path / "a.csv", ["t_s", "east_m", "north_m", "up_m"], rows)

    with pytest.raises(RecordingError, match=sentence):
        scored(file, recording)


@pytest.mark.parametrize(
    ("names", "pattern"),
    [
        (["run_0.tum", "run_1.tum"], "run_{seed}.tum"),
        (["out/10/a2.csv", "out/9/a2.csv", "out/8/a2.csv"], "out/{seed}/a2.csv"),
        (["alone_3.tum"], "alone_3.tum"),
        (["run_{seed}.tum"], "run_{seed}.tum"),
    ],
)
def test_the_number_that_tells_files_apart_is_the_seed(names, pattern):
    assert pattern_of(names) == pattern


@pytest.mark.parametrize(
    "names", [["a.tum", "b.tum"], ["a0_0.tum", "a1_1.tum"], ["a_00.tum", "a_01.tum"], ["a_1.tum", "b_2.tum"]]
)
def test_files_that_no_one_number_tells_apart_are_refused(names):
    with pytest.raises(RecordingError, match="must differ in one number, the seed"):
        pattern_of(names)


def test_seeds_are_in_the_order_of_their_numbers(tmp_path):
    for seed in (10, 9, 2):
        (tmp_path / f"[x]_{seed}.tum").write_text("")
    (tmp_path / "[x]_old.tum").write_text("")
    assert list(seeds_of(str(tmp_path / "[x]_{seed}.tum"))) == [2, 9, 10]
    pattern = str(tmp_path / "{seed}.tum")
    digests = set()
    for contents in ({0: "a"}, {0: "b"}, {0: "a", 1: "b"}, {0: "b", 1: "a"}):
        for seed, content in contents.items():
            (tmp_path / f"{seed}.tum").write_text(content)
        digests.add(files_digest(pattern))
    assert len(digests) == 4
    with pytest.raises(RecordingError, match=r"The trajectory .* does not exist"):
        files_digest(str(tmp_path / "x{seed}.tum"))


START_NS = 1_715_695_200_250_000_000
TURN = Rotation.from_euler("ZYX", [0.7, -0.2, 0.1])
"""Yaw, pitch, roll."""


def bag(path, stamps_ns, topics=("/odometry/filtered",), **more):
    """At each stamp t: east t, forward speed 2, on every topic."""
    with Writer(path) as writer:
        places = {topic: writer.add_connection(topic, "nav_msgs/msg/Odometry", typestore=ROS1) for topic in topics}
        for ns in stamps_ns:
            p = ((ns - START_NS) * 1e-9, -5.0, 2.0)
            msgtype, message = odometry(ROS1, ns, p, TURN.as_quat(), (2, 0, 0), frame="map", child="base_link", **more)
            for connection in places.values():
                writer.write(connection, ns, ROS1.serialize_ros1(message, msgtype))
    return path


def test_poses_twists_and_covariances_arrive_in_enu(tmp_path, recording):
    path = bag(tmp_path / "a.bag", [START_NS, START_NS + 10**9], pose_variance=0.25, twist_variance=0.01)
    read = read_trajectory(path, TrajectoryForm(), recording)
    np.testing.assert_allclose(read.t_s, [0.0, 1.0], atol=1e-9)
    np.testing.assert_allclose(read.enu_m, [[0.0, -5.0, 2.0], [1.0, -5.0, 2.0]], atol=1e-9)
    np.testing.assert_allclose(read.velocity_mps, [TURN.apply([2, 0, 0])] * 2, atol=1e-12)
    np.testing.assert_allclose(read.euler_rad, [[0.1, -0.2, 0.7]] * 2, atol=1e-12)
    np.testing.assert_allclose(read.covariance[1], np.diag([0.25] * 3 + [0.01] * 3), atol=1e-15)
    path = bag(tmp_path / "b.bag", [START_NS, START_NS + 10**9], pose_variance=0.0)
    assert read_trajectory(path, TrajectoryForm(), recording).covariance is None


def test_of_a_recording_without_a_date_the_bag_begins_where_an_exported_one_does(tmp_path, recording):
    begin_ns = 1_577_836_800 * 10**9  # 2020-01-01
    path = bag(tmp_path / "a.bag", [begin_ns + 2 * 10**9, begin_ns + 3 * 10**9])
    read = read_trajectory(path, TrajectoryForm(), replace(recording, start_utc=None))

    np.testing.assert_allclose(read.t_s, [2.0, 3.0], atol=1e-9)


def test_of_two_topics_one_is_named(tmp_path, recording):
    path = bag(tmp_path / "a.bag", [START_NS, START_NS + 10**9], ("/odometry/filtered", "/truth"))

    with pytest.raises(RecordingError, match=r"nav_msgs/msg/Odometry \(/odometry/filtered, /truth\)"):
        read_trajectory(path, TrajectoryForm(), recording)
    assert len(read_trajectory(path, TrajectoryForm(topic="/truth"), recording).t_s) == 2
    with pytest.raises(RecordingError, match="There is no topic '/odometry/filterd'"):
        read_trajectory(path, TrajectoryForm(topic="/odometry/filterd"), recording)


def test_a_stamp_that_is_there_twice_is_refused(tmp_path, recording):
    path = bag(tmp_path / "a.bag", [START_NS, START_NS, START_NS + 10**9])

    with pytest.raises(RecordingError, match="1 of 3 stamps do not increase"):
        read_trajectory(path, TrajectoryForm(), recording)
