"""Small bags, written by rosbags directly: a Fixposition-like drive due east, with whatever is to be wrong with it."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from jerkbench.jobs.names import choose
from jerkbench.plugins import create

ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
START_NS = 1_700_000_000_000_000_000  # 2023-11-14
IMU_TYPE = "sensor_msgs/msg/Imu"
DELAY_NS = 20_000_000
EARTH_M = 6_378_137.0
STANDS_S, SPEED_MPS = 2.0, 1.0


def message(store, name, *values):
    return store.types[name](*values)


def stamp(store, ns):
    return message(store, "builtin_interfaces/msg/Time", ns // 10**9, ns % 10**9)


def header(store, ns, frame):
    return (
        message(store, "std_msgs/msg/Header", 0, stamp(store, ns), frame)
        if store is ROS1
        else (message(store, "std_msgs/msg/Header", stamp(store, ns), frame))
    )


def vector(store, values):
    return message(store, "geometry_msgs/msg/Vector3", *map(float, values))


def quaternion(store, values):
    return message(store, "geometry_msgs/msg/Quaternion", *map(float, values))


def imu(store, ns, accel=(0, 0, 9.81), gyro=(0, 0, 0), q=(0, 0, 0, 0), frame="FP_POI"):
    zeros = np.zeros(9)
    body = (quaternion(store, q), zeros, vector(store, gyro), zeros, vector(store, accel), zeros)
    return "sensor_msgs/msg/Imu", message(store, "sensor_msgs/msg/Imu", header(store, ns, frame), *body)


def fix(store, ns, lat=0.0, lon=10.0, height=0.0, covariance=(4e-4, 1e-4, 9e-4), status=2, frame="FP_A"):
    matrix = np.diag(np.asarray(covariance, dtype=float)).ravel() if len(covariance) == 3 else np.asarray(covariance)
    state = message(store, "sensor_msgs/msg/NavSatStatus", status, 1)
    body = (state, float(lat), float(lon), float(height), matrix, 2)
    return "sensor_msgs/msg/NavSatFix", message(store, "sensor_msgs/msg/NavSatFix", header(store, ns, frame), *body)


def odometry(store, ns, p, q, v=(0, 0, 0), pose_variance=1e-4, twist_variance=1e-4, frame="FP_ECEF", child="FP_POI"):
    point = message(store, "geometry_msgs/msg/Point", *map(float, p))
    pose = message(store, "geometry_msgs/msg/Pose", point, quaternion(store, q))
    twist = message(store, "geometry_msgs/msg/Twist", vector(store, v), vector(store, (0, 0, 0)))
    body = (
        message(store, "geometry_msgs/msg/PoseWithCovariance", pose, pose_variance * np.eye(6).ravel()),
        message(store, "geometry_msgs/msg/TwistWithCovariance", twist, twist_variance * np.eye(6).ravel()),
    )
    return "nav_msgs/msg/Odometry", message(store, "nav_msgs/msg/Odometry", header(store, ns, frame), child, *body)


def at(east_m, lon0_deg=10.0):
    """On the equator: longitude [deg], ECEF position, and the quaternion from a body that heads east to ECEF."""
    lon = np.radians(lon0_deg) + east_m / EARTH_M
    # body x = east, y = north, z = up: ENU axes in ECEF are the columns of Rz(lon) [[0,0,1],[1,0,0],[0,1,0]]
    half = lon / 2
    turn, axes = np.array([0, 0, np.sin(half), np.cos(half)]), np.array([0.5, 0.5, 0.5, 0.5])
    return np.degrees(lon), EARTH_M * np.array([np.cos(lon), np.sin(lon), 0.0]), multiplied(turn, axes)


def multiplied(a, b):
    """Product of quaternions x, y, z, w."""
    return np.array([*(a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])), a[3] * b[3] - a[:3] @ b[:3]])


def east_m(t):
    return SPEED_MPS * max(0.0, t - STANDS_S)


def fixposition(path, **parameters):
    """The data set that reads the bag of a `Drive`."""
    return create("dataset", choose("dataset", {"name": "fixposition", "file": str(path), **parameters}).plain)


@dataclass
class Drive:
    """Messages by topic: (bag time, type, message); change them, then write."""

    store: object = ROS1
    odometry_topic: str = "/fixposition/odometry_ecef"
    duration_s: float = 10.0
    imu_hz: int = 50
    rows: dict = field(default_factory=dict)

    def __post_init__(self):
        noise = np.random.default_rng(0)
        for k in range(1, round(self.duration_s * self.imu_hz) + 1):
            ns = START_NS + k * 10**9 // self.imu_hz
            gyro, accel = 1e-3 * noise.normal(size=3), np.array([0, 0, 9.81]) + 1e-2 * noise.normal(size=3)
            self.add("/fixposition/poiimu", ns, imu(self.store, ns, accel, gyro))
        for k in range(1, round(self.duration_s * 10) + 1):
            t, ns = k / 10, START_NS + k * 10**8
            _, p, q = at(east_m(t))
            v = (SPEED_MPS if t > STANDS_S else 0.0, 0.0, 0.0)
            self.add(self.odometry_topic, ns, odometry(self.store, ns, p, q, v))
        for k in range(1, round(self.duration_s * 5) + 1):
            ns = START_NS + k * 2 * 10**8
            self.add("/fixposition/gnss1", ns, fix(self.store, ns, lon=at(east_m(k / 5))[0]))

    def add(self, topic, ns, typed, delay_ns=DELAY_NS):
        self.rows.setdefault(topic, []).append([ns + delay_ns, *typed])

    def messages(self, topic):
        return [row[2] for row in self.rows[topic]]

    def write(self, path, compression=None):
        return write_bag(path, self.rows, self.store, compression)


def write_bag(path, rows, store, compression=None, empty=None):
    path = Path(path)
    one = store is ROS1
    if one:
        writer = Writer1(path)
        if compression:
            writer.set_compression(Writer1.CompressionFormat[compression.upper()])
    else:
        plugin = StoragePlugin.MCAP if path.suffix == ".mcap" else StoragePlugin.SQLITE3
        writer = Writer2(path, version=9, storage_plugin=plugin)
        if compression:
            from rosbags.rosbag2 import CompressionFormat, CompressionMode

            writer.set_compression(CompressionMode[compression.upper()], CompressionFormat.ZSTD)
    with writer:
        connections = {
            topic: writer.add_connection(topic, some[0][1], typestore=store) for topic, some in rows.items() if some
        }
        for topic, msgtype in (empty or {}).items():
            writer.add_connection(topic, msgtype, typestore=store)
        everything = [(row[0], topic, row) for topic, some in rows.items() for row in some]
        for bag_ns, topic, row in sorted(everything, key=lambda one: one[0]):
            raw = store.serialize_ros1(row[2], row[1]) if one else store.serialize_cdr(row[2], row[1])
            writer.write(connections[topic], bag_ns, raw)
    return path
