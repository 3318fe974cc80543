"""Topics of a bag in the order in which they were recorded: the numbers of rosbags' own deserialiser, to the bit."""

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from bag_maker import IMU_TYPE, ROS1, ROS2, Drive, imu, write_bag
from jerkbench.io.bag import open_bag
from jerkbench.io.bag_decode import decode

FIELDS = {
    "/fixposition/poiimu": ("angular_velocity", "linear_acceleration"),
    "/fixposition/gnss1": ("status", "latitude", "position_covariance"),
    "/fixposition/odometry_ecef": ("position", "orientation", "linear", "linear_covariance"),
}
FORMATS = [(ROS1, "a.bag", None), (ROS1, "a.bag", "lz4"), (ROS1, "a.bag", "bz2"), (ROS2, "a", None)]
FORMATS += [(ROS2, "a.mcap", None), (ROS2, "a.mcap", "storage")]
HUSKY = {"/imu/data": ("linear_acceleration",), "/fix": ("latitude", "position_covariance")}
HUSKY |= {"/husky_velocity_controller/odom": ("linear", "position")}
XSENS = {"/xsens/imu_data": ("linear_acceleration",), "/stereo_odometer/odometry": ("position", "linear")}


IMU = {"/imu": ("linear_acceleration",)}


def read(path, wanted):
    """What was read, after it was compared with rosbags, message by message."""
    with open_bag(path) as bag:
        found = bag.read(wanted)
    store = ROS1 if path.suffix == ".bag" else ROS2
    with AnyReader([path], default_typestore=store) as reader:
        for topic, fields in wanted.items():
            connections = [c for c in reader.connections if c.topic == topic]
            _, times, raw = zip(*reader.messages(connections), strict=True)
            expected = decode(raw, connections[0].msgtype, fields, reader.deserialize)
            assert (found[topic].topic, found[topic].msgtype) == (topic, connections[0].msgtype)
            assert (found[topic].frame_id, found[topic].child_frame_id) == expected.strings
            np.testing.assert_array_equal(found[topic].bag_ns, times)
            np.testing.assert_array_equal(found[topic].stamp_ns, expected.stamp_ns)
            for name in fields:
                assert found[topic][name].tobytes() == expected.values[name].tobytes()
    return found


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
        from rosbags.rosbag1 import Writer as Writer1
        from rosbags.rosbag2 import StoragePlugin
        from rosbags.rosbag2 import Writer as Writer2

        plugin = StoragePlugin.MCAP if name == "a.mcap" else StoragePlugin.SQLITE3
        with Writer1(path) if store is ROS1 else Writer2(path, version=9, storage_plugin=plugin) as writer:
            to = writer.add_connection("/imu", "sensor_msgs/msg/Imu", typestore=store)
            for ns in times:
                _, message = imu(store, 100 + ns, accel=(ns, 0, 0))
                serialise = store.serialize_ros1 if store is ROS1 else store.serialize_cdr
                writer.write(to, ns, serialise(message, "sensor_msgs/msg/Imu"))
        np.testing.assert_array_equal(read(path, IMU)["/imu"]["linear_acceleration"][:, 0], sorted(times))


def test_two_publishers_of_one_topic_are_merged_by_time(tmp_path):
    from rosbags.rosbag1 import Writer

    with Writer(tmp_path / "a.bag") as writer:
        both_of = [writer.add_connection("/imu", IMU_TYPE, typestore=ROS1, callerid=one) for one in ("a", "b")]
        for k in range(300):
            for connection, later in zip(both_of, (0, k % 3), strict=True):
                _, message = imu(ROS1, 1000 + 10 * k, accel=(k, connection.id, 0))
                writer.write(connection, 1000 + 10 * k + later, ROS1.serialize_ros1(message, IMU_TYPE))
    assert len(read(tmp_path / "a.bag", IMU)["/imu"]) == 600
