"""Topics of a bag in the order in which they were recorded: the numbers of rosbags' own deserialiser, to the bit."""

from operator import attrgetter

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2

from bag_maker import IMU_TYPE, ROS1, ROS2, START_NS, Drive, imu, odometry, write_bag
from jerkbench.io.bag import open_bag

FIELDS = {
    "/fixposition/poiimu": ("angular_velocity", "linear_acceleration"),
    "/fixposition/gnss1": ("status", "latitude", "position_covariance"),
    "/fixposition/odometry_ecef": ("position", "orientation", "linear"),
}
FORMATS = [(ROS1, "a.bag", None), (ROS1, "a.bag", "lz4"), (ROS1, "a.bag", "bz2"), (ROS2, "a", None)]
FORMATS += [(ROS2, "a.mcap", None), (ROS2, "a.mcap", "storage")]
HUSKY = {"/imu/data": ("linear_acceleration",), "/fix": ("latitude", "position_covariance")}
HUSKY |= {"/husky_velocity_controller/odom": ("linear", "position")}
XSENS = {"/xsens/imu_data": ("linear_acceleration",), "/stereo_odometer/odometry": ("position", "linear")}


IMU = {"/imu": ("linear_acceleration",)}


def plain(value):
    """The numbers of a field as rosbags gives them."""
    if hasattr(value, "x"):
        return [getattr(value, axis) for axis in "xyzw" if hasattr(value, axis)]
    return np.atleast_1d(value)


PATHS = {
    "nav_msgs/msg/Odometry": {"position": "pose.pose.position", "orientation": "pose.pose.orientation"},
    "sensor_msgs/msg/NavSatFix": {"status": "status.status"},
}
PATHS["nav_msgs/msg/Odometry"]["linear"] = "twist.twist.linear"


def read(path, wanted):
    """Read topics, and compare them with rosbags, message by message."""
    with open_bag(path) as bag:
        found = bag.read(wanted)
    with AnyReader([path], default_typestore=ROS1 if path.suffix == ".bag" else ROS2) as reader:
        for topic, fields in wanted.items():
            connections = [c for c in reader.connections if c.topic == topic]
            _, times, raw = zip(*reader.messages(connections), strict=True)
            msgtype = connections[0].msgtype
            expected = [reader.deserialize(one, msgtype) for one in raw]
            assert (found[topic].topic, found[topic].msgtype) == (topic, msgtype)
            assert found[topic].frame_id == expected[0].header.frame_id
            np.testing.assert_array_equal(found[topic].bag_ns, times)
            stamps = [one.header.stamp.sec * 10**9 + one.header.stamp.nanosec for one in expected]
            np.testing.assert_array_equal(found[topic].stamp_ns, stamps)
            for name in fields:
                get = attrgetter(PATHS.get(msgtype, {}).get(name, name))
                np.testing.assert_array_equal(found[topic][name], [plain(get(one)) for one in expected])
    return found


def test_blocks_of_covariances_are_the_right_ones(tmp_path):
    name, one = odometry(ROS1, START_NS, np.ones(3), np.ones(4), np.ones(3), 1.0, 1.0, "odom", "base")
    one.pose.covariance[:], one.twist.covariance[:] = np.arange(36), 100 + np.arange(36)
    path = write_bag(tmp_path / "a.bag", {"/odom": [[START_NS, name, one]]}, ROS1)
    fields = ("position_covariance", "orientation_covariance", "linear_covariance")
    with open_bag(path) as bag:
        messages = bag.read({"/odom": fields})["/odom"]
    assert (messages.frame_id, messages.child_frame_id) == ("odom", "base")
    block = np.array([0, 1, 2, 6, 7, 8, 12, 13, 14])
    for field, first in zip(fields, (0, 21, 100), strict=True):
        np.testing.assert_array_equal(messages[field][0], first + block)


@pytest.mark.parametrize(("store", "name", "compression"), FORMATS)
def test_every_format_is_read(tmp_path, store, name, compression):
    found = read(Drive(store, duration_s=30.0).write(tmp_path / name, compression), FIELDS)
    assert len(found["/fixposition/poiimu"]) == 1500


@pytest.mark.parametrize(("name", "wanted"), [("test1.bag", HUSKY), ("xsens.bag", XSENS)])
def test_the_real_bags_too(shared_folder, name, wanted):
    path = shared_folder / "data" / "robot_localization" / name
    if not path.exists():
        pytest.skip("the bags of robot_localization are not in ../shared/data")
    read(path, wanted)


@pytest.mark.parametrize(("store", "name"), [(ROS1, "a.bag"), (ROS2, "a"), (ROS2, "a.mcap")])
def test_messages_of_several_lengths(tmp_path, store, name):
    rows = [[ns, *imu(store, ns, accel=(k, 0, 9.81), frame="a" * (k % 9))] for k, ns in enumerate(range(1, 50))]
    found = read(write_bag(tmp_path / name, {"/imu": rows}, store), IMU)
    np.testing.assert_array_equal(found["/imu"]["linear_acceleration"][:, 0], np.arange(49))


def test_bag_times_that_are_not_in_order_are_sorted(tmp_path):
    times = [5, 3, 4, 9, 8]
    for name, store in (("a.bag", ROS1), ("a.mcap", ROS2), ("a", ROS2)):
        path = tmp_path / name
        plugin = StoragePlugin.MCAP if name == "a.mcap" else StoragePlugin.SQLITE3
        with Writer1(path) if store is ROS1 else Writer2(path, version=9, storage_plugin=plugin) as writer:
            to = writer.add_connection("/imu", "sensor_msgs/msg/Imu", typestore=store)
            for ns in times:
                _, message = imu(store, 100 + ns, accel=(ns, 0, 0))
                serialise = store.serialize_ros1 if store is ROS1 else store.serialize_cdr
                writer.write(to, ns, serialise(message, "sensor_msgs/msg/Imu"))
        np.testing.assert_array_equal(read(path, IMU)["/imu"]["linear_acceleration"][:, 0], sorted(times))


def test_two_publishers_of_one_topic_are_merged_by_time(tmp_path):
    with Writer1(tmp_path / "a.bag") as writer:
        both_of = [writer.add_connection("/imu", IMU_TYPE, typestore=ROS1, callerid=one) for one in ("a", "b")]
        for k in range(300):
            for connection, later in zip(both_of, (0, k % 3), strict=True):
                _, message = imu(ROS1, 1000 + 10 * k, accel=(k, connection.id, 0))
                writer.write(connection, 1000 + 10 * k + later, ROS1.serialize_ros1(message, IMU_TYPE))
    assert len(read(tmp_path / "a.bag", IMU)["/imu"]) == 600
