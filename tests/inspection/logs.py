"""Logs as people keep them, made of a simulated drive, whose truth is known."""

from types import SimpleNamespace

import numpy as np
import pandas as pd

from commands import experiment

example = experiment("../examples/example_log.py")
FRD, GAP_S, LATE_S, SIGMA_M, START_S = example.FRD, example.GAP_S, example.LATE_S, example.SIGMA_M, example.START_S
NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])


def joined(recording, imu, position, velocity):
    """One table: the columns ``imu`` at its stamps, those of ``position`` and ``velocity`` at theirs."""
    streams = [(recording.imu.t_s, imu), (recording.position.t_s, position), (recording.velocity.t_s, velocity)]
    tables = [pd.DataFrame({"ns": np.round(t_s * 1e9).astype(np.int64), **columns}) for t_s, columns in streams]
    first, *others = (table.set_index("ns") for table in tables)
    return first.join(others, how="outer").sort_index().reset_index()


def columns(names, values):
    return dict(zip(names, values.T, strict=True))


def ned_degrees(recording, *, units):
    """NED, FRD, g, deg/s and milliseconds; the names say the ``units``, or nothing of units and frames."""
    imu, position, velocity = recording.imu, recording.position, recording.velocity
    force, rate = imu.accel_mps2 @ FRD / 9.80665, np.degrees(imu.gyro_radps) @ FRD
    place, speed = position.enu_m @ NED.T, velocity.mps @ NED.T
    if units:
        names = ["acc_x_g", "acc_y_g", "acc_z_g"], ["gyro_x_dps", "gyro_y_dps", "gyro_z_dps"]
        names += ["north_m", "east_m", "down_m"], ["vel_north_mps", "vel_east_mps", "vel_down_mps"]
    else:
        names = [[f"{word}{axis}" for axis in "xyz"] for word in ("a", "w", "p", "v")]
    log = joined(
        recording,
        columns(names[0], force) | columns(names[1], rate),
        columns(names[2], place),
        columns(names[3], speed),
    )
    log.insert(0, "time_ms" if units else "t", log.pop("ns") / 1e6)
    return log


def kitti_like(recording, geodetic):
    """The names of KITTI's OXTS, at the rate of the fixes: latitude and longitude, FLU, rad/s."""
    imu, fixes, velocity = recording.imu, recording.position, recording.velocity
    t_s = fixes.t_s[1:-1]

    def at(times, values):
        return np.column_stack([np.interp(t_s, times, column) for column in values.T])

    speed = at(velocity.t_s, velocity.mps)[:, [1, 0, 2]]
    data = {"timestamp": t_s + 1.3e9}
    data |= columns(["lat", "lon", "alt"], geodetic[1:-1]) | columns(["vn", "ve", "vu"], speed)
    data |= columns(["ax", "ay", "az"], at(imu.t_s, imu.accel_mps2))
    data |= columns(["wx", "wy", "wz"], at(imu.t_s, imu.gyro_radps)) | {"navstat": np.full(len(t_s), 4.0)}
    return pd.DataFrame(data)


def gps_week(seconds):
    gps_s = START_S + seconds - 315_964_800 + 18
    return {"GPS Week": (gps_s // 604_800).astype(int), "TOW (s)": np.round(gps_s % 604_800, 4)}


def car_log(folder, *, week=False, seed=7):
    """The log of the tutorial, and what is true of it."""
    names = ("paths", "force_mps2", "rate_radps", "fix_s", "true_m")
    written = example.write_log(folder, seed, gps_week if week else example.unix_time)
    return SimpleNamespace(**dict(zip(names, written, strict=True)))


def car_bag(folder, target):
    """`car_log` as a ROS 2 bag of drivers that publish g and deg/s in FRD; the truth is a topic of fixes."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)

    def of(name, *values):
        return store.types[name](*values)

    def header(t_s):
        stamp_ns = round(t_s * 1e9)
        time = of("builtin_interfaces/msg/Time", *divmod(stamp_ns, 1_000_000_000))
        return stamp_ns, of("std_msgs/msg/Header", time, "sensor")

    def imu(row):
        stamp_ns, head = header(row[0])
        force, rate = (of("geometry_msgs/msg/Vector3", *row[part]) for part in (slice(1, 4), slice(4, 7)))
        none = of("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0), np.array([-1.0] + [0.0] * 8)
        return stamp_ns, of("sensor_msgs/msg/Imu", head, *none, rate, np.zeros(9), force, np.zeros(9))

    def fix(row, sigma_m):
        stamp_ns, head = header(row[0])
        status = of("sensor_msgs/msg/NavSatStatus", 0, 1)
        return stamp_ns, of("sensor_msgs/msg/NavSatFix", head, status, *row[1:4], np.diag(sigma_m**2).ravel(), 2)

    rows = {name: pd.read_csv(folder / f"{name}.csv").to_numpy() for name in ("imu", "gnss", "truth")}
    topics = {
        "/imu/data": ("sensor_msgs/msg/Imu", map(imu, rows["imu"])),
        "/gps/fix": ("sensor_msgs/msg/NavSatFix", (fix(row, row[4:7] / 1000) for row in rows["gnss"])),
        "/truth/fix": ("sensor_msgs/msg/NavSatFix", (fix(row, np.full(3, 0.01)) for row in rows["truth"])),
    }
    with Writer(target, version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, (name, messages) in topics.items():
            connection = writer.add_connection(topic, name, typestore=store)
            for stamp_ns, message in messages:
                writer.write(connection, stamp_ns, store.serialize_cdr(message, name))
