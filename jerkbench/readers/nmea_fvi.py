"""The sentences `$PSAT,FVI` and `$..GST` of a receiver's log: velocities and standard deviations, epoch by epoch."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.readers.text import parse_numbers, read_lines

FVI, GST = "$PSAT,FVI,", "GST,"
FVI_FIELDS, GST_FIELDS = (15, 16, 17), (6, 7, 8)
"""Where east, north and up of the velocity [m/s], and the sigmas of latitude, longitude and height [m], stand."""


@dataclass(frozen=True, eq=False)
class Epochs:
    """The values of the log at each epoch.

    Attributes:
        velocity_mps: (n, 3) ENU.
        sigma_m: (n, 3) of the position, ENU.
    """

    velocity_mps: FloatArray
    sigma_m: FloatArray


def read_epochs(path: Path) -> Epochs:
    """Read the log; sentences of other kinds are left alone.

    Raises:
        RecordingError: no such file, a sentence is damaged, or the two kinds are not of the same epochs.
    """
    lines = read_lines(path)
    fvi = [(number, text) for number, text in lines if text.startswith(FVI)]
    gst = [(number, text) for number, text in lines if text[3:].startswith(GST)]
    stamps = [[_field(path, line, k) for line in kind] for kind, k in ((fvi, 2), (gst, 1))]
    if stamps[0] != stamps[1]:
        raise RecordingError(
            f"{path} has {len(fvi)} sentences {FVI[:-1]} and {len(gst)} GST, which are not of the same epochs; copy it"
            " again."
        )
    sigma_m = _numbers(path, gst, GST_FIELDS)[:, [1, 0, 2]]
    return Epochs(_numbers(path, fvi, FVI_FIELDS), np.asarray(sigma_m))


def _numbers(path: Path, lines: list[tuple[int, str]], fields: tuple[int, ...]) -> FloatArray:
    chosen = [(line[0], " ".join(_field(path, line, k) for k in fields)) for line in lines]
    return parse_numbers(path, chosen, len(fields))


def _field(path: Path, line: tuple[int, str], k: int) -> str:
    number, text = line
    fields = text.partition("*")[0].split(",")
    if len(fields) <= k:
        raise RecordingError(f"{path}, line {number} has {len(fields)} fields, and {k + 1} are needed; it is damaged.")
    return fields[k].strip()
