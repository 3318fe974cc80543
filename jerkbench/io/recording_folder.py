"""A recording as the input of other tools: one table and a JSON that explains it, bags, KF-GINS, pyins."""

import json
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.estimate import Attitude
from jerkbench.files import write_atomically, write_text
from jerkbench.geometry import dcm_from_euler, enu_to_geodetic, euler_from_dcm
from jerkbench.io.bag_writing import write_bag
from jerkbench.io.clocks import GPS_EPOCH_NS, GPST_MINUS_UTC_S, WEEK_NS, ns_since_1970
from jerkbench.io.frames import FLU_FROM_FRD, axes_in_enu, enu_from
from jerkbench.io.writing import recording_table, reference_columns, write_frame
from jerkbench.recording import GRAVITY_MPS2, Imu, Position, Recording, Reference
from jerkbench.timeline import nanoseconds

if TYPE_CHECKING:
    import pandas as pd

EVALUATED = "evaluated"
_ANGLES = ("attitude_roll_rad", "attitude_pitch_rad", "attitude_yaw_rad")
INPUTS = ("attitude_accel_east_mps2", "attitude_accel_north_mps2", "attitude_accel_up_mps2")
"""Columns that are no measurement: what the attitude filter makes of the IMU."""

_UNITS = dict(
    zip(
        ["s", "m", "mps", "mps2", "radps", "rad", "m2", "m2ps2"],
        ["s", "m", "m/s", "m/s2", "rad/s", "rad", "m2", "m2/s2"],
        strict=True,
    )
)
"""The unit behind the end of a column's name."""

_SAID = tomllib.loads(Path(__file__).with_name("recording.toml").read_text(encoding="utf-8"))


def input_table(recording: Recording, attitude: Attitude | None = None) -> "pd.DataFrame":
    """Return a row for each stamp of any stream and of the reference, empty where a stream has no value.

    ``evaluated`` is 1 where the reference has a stamp; of the reference itself nothing is in it.
    """
    table = recording_table(_bare(recording))
    t_ns = nanoseconds(table["t_s"].to_numpy())
    table.insert(1, EVALUATED, np.isin(t_ns, nanoseconds(recording.reference.t_s)).astype(np.int64))
    if attitude is None or recording.imu is None:
        return table
    rows = np.searchsorted(t_ns, nanoseconds(attitude.t_s))
    for names, values in ((_ANGLES, attitude.euler_rad), (INPUTS, attitude.accel_enu_mps2)):
        for name, column in zip(names, values.T, strict=True):
            table[name] = np.nan
            table.loc[rows, name] = column
    return table


def _bare(recording: Recording) -> Recording:
    """Without what the reference knows."""
    return replace(recording, reference=Reference(recording.reference.t_s, "not told", independent=False))


def write_input(table: "pd.DataFrame", recording: Recording, path: Path, more: Mapping[str, Any]) -> list[Path]:
    """Write the table (.csv or .parquet), and beside it the JSON, which tells ``more`` as well; returns the files."""
    write_frame(table, path)
    beside = path.with_suffix(".json")
    write_text(beside, json.dumps({**described(recording, table, path.name), **more}, indent=1) + "\n")
    return [path, beside]


def write_reference(recording: Recording, path: Path) -> None:
    """Write what a method does not get: the reference, and at which of its stamps errors count."""
    import pandas as pd

    reference = recording.reference
    columns = {"t_s": reference.t_s, **reference_columns(recording, "enu"), "scored": reference.scored.astype(int)}
    write_frame(pd.DataFrame(columns), path)


def described(recording: Recording, table: "pd.DataFrame", name: str) -> dict[str, Any]:
    """Return what a reader of the table has to know: frames, units, rates, origin, start."""
    start, origin = recording.start_utc, recording.origin
    return {
        "format": _SAID["format"],
        "name": recording.name,
        "table": name,
        "time": _SAID["time"] | {"start_utc": start.isoformat() if start else None},
        EVALUATED: _SAID[EVALUATED],
        "frames": _SAID["frames"],
        "origin": asdict(origin) if origin else None,
        "gravity_mps2": GRAVITY_MPS2,
        "static_start_s": recording.static_start_s,
        "streams": _streams(recording, [str(column) for column in table.columns]),
        "write": _SAID["write"],
        "notes": list(recording.notes),
    }


def _streams(recording: Recording, columns: list[str]) -> dict[str, Any]:
    streams = {}
    for name in ("imu", "position", "velocity", "heading", "attitude"):
        stream = getattr(recording, "imu" if name == "attitude" else name)
        begins = ("accel_", "gyro_") if name == "imu" else f"{name}_"
        own = [column for column in columns if column.startswith(begins)]
        if stream is None or not own:
            continue
        t_s = stream.t_s
        rate = round(1.0 / float(np.median(np.diff(t_s))), 6) if len(t_s) > 1 else None
        units = {column: _UNITS[column.rpartition("_")[2]] for column in own}
        streams[name] = {"about": _SAID["streams"][name], "rows": len(t_s), "rate_hz": rate, "columns": units}
        if name in ("position", "velocity"):
            streams[name]["assumed_lever_arm_m"] = [0.0, 0.0, 0.0]
        more = {"velocity": "frame", "heading": "source"}.get(name)
        if more:
            streams[name][more] = getattr(stream, more)
    return streams


# The files of KF-GINS.

CONFIGURATION = Path(__file__).with_name("kf-gins.yaml")
"""Of KF-GINS, with the parts of a recording left open."""


def write_kf_gins(recording: Recording, attitude: Attitude | None, folder: Path) -> list[Path]:
    """Write imu.txt, gnss.txt and kf-gins.yaml; KF-GINS takes no velocity and no heading. Returns the files.

    Times are GPS seconds of the week in which the recording begins. The configuration starts at the first fix, with
    its place, the last velocity until then and the attitude there, and is meant to be edited.

    Raises:
        RecordingError: the recording has no IMU, fix, attitude, origin or start.
    """
    position = recording.position
    if position is None or recording.origin is None or recording.start_utc is None or attitude is None:
        raise RecordingError(
            f"{recording.name} cannot be written for KF-GINS, which needs an IMU, fixes, an origin on the Earth and a"
            " start in UTC."
        )
    week, zero_s = _gps_week(recording)
    whole = np.isfinite(position.enu_m).all(axis=1)
    fixes, first = _fixes(recording, position), int(np.argmax(whole))
    text = CONFIGURATION.read_text(encoding="utf-8").format(
        folder=folder.resolve(),
        week=week,
        rate_hz=round(1.0 / recording.inertial.nominal_interval_s),
        start_s=f"{zero_s + float(position.t_s[first]):.9f}",
        end_s=f"{zero_s + recording.duration_s:.9f}",
        position=[round(float(value), 10) for value in fixes[first, 1:4]],
        velocity=_velocity_ned(recording, position.t_s[first]),
        attitude=_attitude_ned(attitude, position.t_s[first]),
        position_sd=[round(float(value), 4) for value in fixes[first, 4:]],
    )
    fixes[:, 0] += zero_s
    lines = {
        "imu.txt": _lines(imu_increments(recording.inertial, zero_s), "%.9f" + " %.12e" * 6),
        "gnss.txt": _lines(fixes[whole], "%.9f %.11f %.11f %.5f %.5f %.5f %.5f"),
        "kf-gins.yaml": text,
    }
    for name, content in lines.items():
        write_text(folder / name, content)
    return [folder / name for name in lines]


def imu_increments(imu: Imu, zero_s: float) -> FloatArray:
    """Return (n, 7): time, rotation [rad] and change of velocity [m/s] over the interval that ends there, FRD."""
    interval_s = imu.intervals_s[:, None]
    turned = [values @ FLU_FROM_FRD * interval_s for values in (imu.gyro_radps, imu.accel_mps2)]
    return np.column_stack([zero_s + imu.t_s, *turned])


def _fixes(recording: Recording, position: Position) -> FloatArray:
    """(m, 7): time, latitude, longitude [deg], height [m], standard deviations north, east, down [m]."""
    assert recording.origin is not None  # noqa: S101 - asked for above
    sigma = np.sqrt(np.diagonal(position.covariance_m2, axis1=1, axis2=2))[:, [1, 0, 2]]
    return np.column_stack([position.t_s, enu_to_geodetic(position.enu_m, recording.origin), sigma])


def _attitude_ned(attitude: Attitude, t_s: float) -> list[float]:
    """Roll, pitch, yaw [deg] of the body FRD in NED."""
    at = min(int(np.searchsorted(attitude.t_s, t_s)), len(attitude.t_s) - 1)
    ned_from_frd = enu_from("ned").T @ dcm_from_euler(attitude.euler_rad[at]) @ FLU_FROM_FRD
    return [round(float(value), 6) for value in np.degrees(euler_from_dcm(ned_from_frd[None])[0])]


def _velocity_ned(recording: Recording, t_s: float) -> list[float]:
    """The last velocity in ENU that is whole until ``t_s``; zero where there is none."""
    velocity = recording.velocity
    if velocity is None or velocity.frame != "enu":
        return [0.0, 0.0, 0.0]
    rows = np.flatnonzero((velocity.t_s <= t_s) & np.isfinite(velocity.mps).all(axis=1))
    east, north, up = velocity.mps[rows[-1]] if len(rows) else (0.0, 0.0, 0.0)
    return [round(float(north), 4), round(float(east), 4), round(float(-up), 4)]


def _gps_week(recording: Recording) -> tuple[int, float]:
    """The GPS week of the recording's start, and its second of the week."""
    assert recording.start_utc is not None  # noqa: S101 - asked for above
    gpst_ns = ns_since_1970(recording.start_utc) + round(GPST_MINUS_UTC_S * 1e9)
    week, rest_ns = divmod(gpst_ns - GPS_EPOCH_NS, WEEK_NS)
    return week, rest_ns * 1e-9


def _lines(table: FloatArray, row: str) -> str:
    return "".join(row % tuple(values) + "\n" for values in table.tolist())


# A recording as the tables of pyins (python-ins): its names, NED, the body FRD, degrees.

_PLACE, _VELOCITY, _ATTITUDE = ("lat", "lon", "alt"), ("VN", "VE", "VD"), ("roll", "pitch", "heading")
_IMU = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")

Frame = dict[str, FloatArray]


def write_pyins(recording: Recording, attitude: Attitude | None, folder: Path) -> list[Path]:
    """Write imu.csv, position.csv and, where there are such, velocity.csv and attitude.csv; returns the files.

    The first column is the time, the index of pyins' tables; ``sd`` is the root of the mean variance, as pyins takes
    one standard deviation for all axes and times.

    Raises:
        RecordingError: the recording has no IMU or no origin.
    """
    frames = pyins_frames(recording, attitude)
    for name, frame in frames.items():
        write_atomically(folder / f"{name}.csv", partial(_write, frame))
    return [folder / f"{name}.csv" for name in frames]


def pyins_frames(recording: Recording, attitude: Attitude | None) -> dict[str, Frame]:
    """Return each table as its columns.

    Raises:
        RecordingError: as above.
    """
    if recording.imu is None or recording.origin is None:
        raise RecordingError(f"{recording.name} cannot be written for pyins, which needs an IMU and an origin.")
    imu, position, velocity = recording.imu, recording.position, recording.velocity
    measured = np.hstack([imu.gyro_radps @ FLU_FROM_FRD, imu.accel_mps2 @ FLU_FROM_FRD])
    frames = {"imu": _frame(imu.t_s, _IMU, measured)}
    if position is not None:
        places = _frame(position.t_s, _PLACE, enu_to_geodetic(position.enu_m, recording.origin))
        frames["position"] = places | {"sd": _deviations(position.covariance_m2)}
    if velocity is not None and velocity.frame == "enu":
        ned = _frame(velocity.t_s, _VELOCITY, axes_in_enu(velocity.mps, "ned"))  # the exchange is its own inverse
        frames["velocity"] = ned | {"sd": _deviations(velocity.covariance_m2ps2)}
    if attitude is not None:
        turns = enu_from("ned").T @ dcm_from_euler(attitude.euler_rad) @ FLU_FROM_FRD
        frames["attitude"] = _frame(attitude.t_s, _ATTITUDE, np.degrees(euler_from_dcm(turns)))
    return frames


def _write(frame: Frame, path: Path) -> None:
    import pandas as pd

    pd.DataFrame(frame).to_csv(path, index=False, float_format="%.14g")


def _frame(t_s: FloatArray, names: tuple[str, ...], values: FloatArray) -> Frame:
    return {"time": t_s, **dict(zip(names, values.T, strict=True))}


def _deviations(covariance: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.trace(covariance, axis1=1, axis2=2) / 3.0))


# A recording in a folder, in every format that is asked for.

Write = Callable[[Recording, Attitude | None, Path], list[Path]]

FORMATS: dict[str, str] = {name: f"recording.{name}" for name in ("csv", "parquet", "bag", "mcap")}
FORMATS |= {"kf_gins": "kf_gins", "pyins": "pyins"}
"""Each format, and the file or folder that it is written to."""

_SEVERAL: Mapping[str, Write] = {"kf_gins": write_kf_gins, "pyins": write_pyins}


def write_recording(
    recording: Recording, attitude: Attitude | None, folder: Path, formats: Sequence[str], more: Mapping[str, Any]
) -> list[Path]:
    """Write the recording, without its reference, in each of the ``formats``; returns the files.

    Args:
        recording: what is written.
        attitude: of it, for the formats that have a place for it.
        folder: where to.
        formats: names of `FORMATS`.
        more: what else the JSON beside a table is to tell.

    Raises:
        RecordingError: a format needs something that the recording lacks.
    """
    written: list[Path] = []
    for name in formats:
        path = folder / FORMATS[name]
        if name in ("csv", "parquet"):
            written += write_input(input_table(recording, attitude), recording, path, more)
        elif name in _SEVERAL:
            written += _SEVERAL[name](recording, attitude, path)
        elif recording.imu is None:
            raise RecordingError(f"{recording.name} has no IMU, and a bag is written with one; write csv or parquet.")
        else:
            write_bag(_bare(recording), path)
            written.append(path)
    return written
