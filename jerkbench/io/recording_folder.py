"""A recording in a folder, in every format that is asked for."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from jerkbench.errors import RecordingError
from jerkbench.estimate import Attitude
from jerkbench.io.method_input import input_table, write_input
from jerkbench.io.other_tools import write_kf_gins, write_pyins
from jerkbench.io.ros.writing import write_bag
from jerkbench.recording import Recording, Reference

Write = Callable[[Recording, Attitude | None, Path], list[Path]]

FORMATS: Mapping[str, str] = {
    "csv": "recording.csv",
    "parquet": "recording.parquet",
    "bag": "recording.bag",
    "mcap": "recording.mcap",
    "kf_gins": "kf_gins",
    "pyins": "pyins",
}
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
    return [path for name in formats for path in _written(recording, attitude, folder / FORMATS[name], name, more)]


def _written(
    recording: Recording, attitude: Attitude | None, path: Path, name: str, more: Mapping[str, Any]
) -> list[Path]:
    if name in ("csv", "parquet"):
        return write_input(input_table(recording, attitude), recording, path, more)
    if name in _SEVERAL:
        return _SEVERAL[name](recording, attitude, path)
    if recording.imu is None:
        raise RecordingError(f"{recording.name} has no IMU, and a bag is written with one; write csv or parquet.")
    bare = Reference(recording.reference.t_s, "not told", independent=False)
    write_bag(replace(recording, reference=bare), path)
    return [path]
