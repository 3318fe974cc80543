"""Odometry that a node has published, against a motion that is written down here."""

from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from scipy.spatial.transform import Rotation

from bag_maker import ROS1, odometry
from jerkbench.errors import RecordingError
from jerkbench.io.trajectory import TrajectoryForm, read_trajectory
from jerkbench.plugins.samples import small_recording

START_UTC = datetime(2024, 5, 14, 14, 0, 0, 250_000, tzinfo=UTC)
START_NS = 1_715_695_200_250_000_000
TURN = Rotation.from_euler("ZYX", [0.7, -0.2, 0.1])
"""Yaw, pitch, roll."""


@pytest.fixture(scope="module")
def recording():
    return replace(small_recording(), start_utc=START_UTC)


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


def test_a_covariance_of_zeros_is_none(tmp_path, recording):
    path = bag(tmp_path / "a.bag", [START_NS, START_NS + 10**9], pose_variance=0.0)

    assert read_trajectory(path, TrajectoryForm(), recording).covariance is None


def test_of_a_recording_without_a_date_the_bag_begins_where_an_exported_one_does(tmp_path, recording):
    begin_ns = 1_577_836_800 * 10**9  # 2020-01-01
    path = bag(tmp_path / "a.bag", [begin_ns + 2 * 10**9, begin_ns + 3 * 10**9])
    read = read_trajectory(path, TrajectoryForm(), replace(recording, start_utc=None))

    np.testing.assert_allclose(read.t_s, [2.0, 3.0], atol=1e-9)


def test_of_two_topics_one_is_named(tmp_path, recording):
    path = bag(tmp_path / "a.bag", [START_NS, START_NS + 10**9], ("/odometry/filtered", "/truth"))

    with pytest.raises(RecordingError, match=r"2 topics of nav_msgs/msg/Odometry: /odometry/filtered, /truth; name"):
        read_trajectory(path, TrajectoryForm(), recording)
    assert len(read_trajectory(path, TrajectoryForm(topic="/truth"), recording).t_s) == 2
    with pytest.raises(RecordingError, match="There is no topic '/odometry/filterd'"):
        read_trajectory(path, TrajectoryForm(topic="/odometry/filterd"), recording)


def test_a_stamp_that_is_there_twice_is_refused(tmp_path, recording):
    path = bag(tmp_path / "a.bag", [START_NS, START_NS, START_NS + 10**9])

    with pytest.raises(RecordingError, match="1 of 3 messages are not later than the one before"):
        read_trajectory(path, TrajectoryForm(), recording)
