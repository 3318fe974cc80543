"""Logs as people keep them, made of a simulated drive, whose truth is known."""

import numpy as np
import pandas as pd

FRD = np.diag([1.0, -1.0, -1.0])
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
