"""Topics cut out of a bag in bulk: the ordinary reader's values, to the bit."""

import sqlite3
from contextlib import closing

import numpy as np
import pytest

from bag_maker import IMU_TYPE, ROS1, ROS2, Drive, imu, write_bag
from jerkbench.io.ros.bag import Bag, open_bag
from jerkbench.io.ros.files import BagError

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


def assert_same(one, other):
    assert list(one) == list(other)
    for topic, expected in other.items():
        found = one[topic]
        assert (found.topic, found.msgtype, found.frame_id, found.child_frame_id) == (
            (expected.topic, expected.msgtype, expected.frame_id, expected.child_frame_id)
        )
        np.testing.assert_array_equal(found.bag_ns, expected.bag_ns)
        np.testing.assert_array_equal(found.stamp_ns, expected.stamp_ns)
        assert found.values.keys() == expected.values.keys()
        for name in expected.values:
            assert found[name].tobytes() == expected[name].tobytes()


def both(path, wanted):
    with open_bag(path) as bag:
        return bag._in_bulk(wanted), bag._one_by_one(wanted, None)


@pytest.mark.parametrize(("store", "name", "compression"), FORMATS)
def test_every_format_is_cut_and_the_same(tmp_path, store, name, compression):
    quick, ordinary = both(Drive(store, duration_s=30.0).write(tmp_path / name, compression), FIELDS)
    assert quick is not None
    assert_same(quick, ordinary)
    assert len(quick["/fixposition/poiimu"]) == 1500


@pytest.mark.parametrize(("name", "wanted"), [("test1.bag", HUSKY), ("xsens.bag", XSENS)])
def test_the_real_bags_too(shared_folder, name, wanted):
    path = shared_folder / "data" / "robot_localization" / name
    if not path.exists():
        pytest.skip("the bags of robot_localization are not in ../shared/data")
    quick, ordinary = both(path, wanted)
    assert quick is not None
    assert_same(quick, ordinary)


@pytest.mark.parametrize(("store", "name"), [(ROS1, "a.bag"), (ROS2, "a"), (ROS2, "a.mcap")])
def test_messages_of_several_lengths_are_left_to_the_ordinary_reader(tmp_path, store, name):
    rows = [[ns, *imu(store, ns, accel=(k, 0, 9.81), frame="a" * (k % 9))] for k, ns in enumerate(range(1, 50))]
    path = write_bag(tmp_path / name, {"/imu": rows}, store)
    quick, ordinary = both(path, {"/imu": ["linear_acceleration"]})
    assert quick is None
    with open_bag(path) as bag:
        assert_same(bag.read({"/imu": ["linear_acceleration"]}), ordinary)
    np.testing.assert_array_equal(ordinary["/imu"]["linear_acceleration"][:, 0], np.arange(49))


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
        quick, ordinary = both(path, {"/imu": ["linear_acceleration"]})
        assert quick is not None
        np.testing.assert_array_equal(quick["/imu"].bag_ns, sorted(times))
        assert_same(quick, ordinary)


def test_two_publishers_of_one_topic_are_merged_by_time(tmp_path):
    from rosbags.rosbag1 import Writer

    with Writer(tmp_path / "a.bag") as writer:
        both_of = [writer.add_connection("/imu", IMU_TYPE, typestore=ROS1, callerid=one) for one in ("a", "b")]
        for k in range(300):
            for connection, later in zip(both_of, (0, k % 3), strict=True):
                _, message = imu(ROS1, 1000 + 10 * k, accel=(k, connection.id, 0))
                writer.write(connection, 1000 + 10 * k + later, ROS1.serialize_ros1(message, IMU_TYPE))
    quick, ordinary = both(tmp_path / "a.bag", {"/imu": ["linear_acceleration"]})
    assert quick is not None
    assert_same(quick, ordinary)


def test_a_cell_of_another_type_in_sqlite_is_left_to_the_ordinary_reader(tmp_path):
    path = Drive(ROS2, duration_s=2.0).write(tmp_path / "a") / "a.db3"
    with closing(sqlite3.connect(path)) as base:
        base.execute("UPDATE messages SET data = 'text' WHERE id = 7")
        base.commit()
    with open_bag(path) as bag:
        assert bag._in_bulk(FIELDS) is None


def same(one, other):
    try:
        assert_same(one, other)
    except AssertionError:
        return False
    return True


@pytest.mark.parametrize(("store", "name", "compression"), FORMATS)
def test_a_flipped_byte_gives_no_other_numbers_than_the_ordinary_reader(tmp_path, store, name, compression):
    """Or those of the sound bag: SQLite's index of times is read by the ordinary reader alone."""
    path = Drive(store, duration_s=2.0).write(tmp_path / name, compression)
    path = next(file for file in path.iterdir() if file.suffix != ".yaml") if path.is_dir() else path
    sound, whole, draw = both(path, FIELDS)[0], path.read_bytes(), np.random.default_rng(len(name))
    harmed = tmp_path / f"harmed{path.suffix}"
    cut = 0
    for _ in range(40):
        content = bytearray(whole)
        content[draw.integers(len(content))] ^= int(draw.integers(1, 256))
        harmed.write_bytes(content)
        try:
            quick, ordinary = both(harmed, FIELDS)
        except BagError:
            continue
        if quick is not None:
            cut += 1
            assert same(quick, ordinary) or same(quick, sound)
    assert cut > 5 or compression


def test_reading_takes_the_quick_way(tmp_path, monkeypatch):
    def never(*_):
        raise AssertionError

    path = Drive(duration_s=2.0).write(tmp_path / "a.bag")
    monkeypatch.setattr(Bag, "_one_by_one", never)
    with open_bag(path) as bag:
        assert len(bag.read(FIELDS)["/fixposition/gnss1"]) == 10
