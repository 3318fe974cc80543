"""A car in a suburb of Beijing: 10 Hz fixes with slowly varying errors, and an RTK receiver as the reference."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray, require_positive
from jerkbench.errors import RecordingError
from jerkbench.io.columns import Columns, TextFormat
from jerkbench.io.files import FromFiles, Line, find_file, read_lines
from jerkbench.io.readers import read_columns
from jerkbench.plugins import register
from jerkbench.recording import Position, Recording, Reference, Velocity

TABLE, _LOG = "Data.txt", "GPSRaw.dat"
_GPS, RTK, RTK_VELOCITY = ("GPS_X", "GPS_Y"), ("RTK_X", "RTK_Y"), ("RTK_Vx", "RTK_Vy")

# In the receiver's log, a sentence `$PSAT,FVI` has the velocity and a sentence `$..GST` the sigmas of an epoch.

FVI, GST = "$PSAT,FVI,", "GST,"
FVI_FIELDS, GST_FIELDS = (15, 16, 17), (6, 7, 8)
"""Indices of the velocity east, north and up [m/s], and of the sigmas of latitude, longitude and height [m]."""


def read_epochs(path: Path) -> tuple[FloatArray, FloatArray]:
    """Return velocities (n, 3) [m/s] and standard deviations of positions (n, 3) [m], in ENU, at each epoch.

    Only the sentences `$PSAT,FVI` and `$..GST` are read.

    Raises:
        RecordingError: the file does not exist, a sentence is damaged, or the two kinds of sentences have different
            epochs.
    """
    lines = read_lines(path)
    fvi = [(number, text) for number, text in lines if text.startswith(FVI)]
    gst = [(number, text) for number, text in lines if text[3:].startswith(GST)]
    stamps = [[_field(path, line, k) for line in kind] for kind, k in ((fvi, 2), (gst, 1))]
    if stamps[0] != stamps[1]:
        raise RecordingError(
            f"{path} has {len(fvi)} {FVI[:-1]} sentences and {len(gst)} GST sentences, and their epochs differ; copy"
            " the file again."
        )
    return _numbers(path, fvi, FVI_FIELDS), _numbers(path, gst, GST_FIELDS)[:, [1, 0, 2]]


def _numbers(path: Path, lines: list[Line], fields: tuple[int, ...]) -> FloatArray:
    import pandas as pd

    rows = [[_field(path, line, k) for k in fields] for line in lines]
    table = pd.DataFrame(rows, [number - 1 for number, _ in lines], list(map(str, fields)))
    return Columns(str(path), table).finite(list(table.columns))


def _field(path: Path, line: Line, k: int) -> str:
    number, text = line
    fields = text.partition("*")[0].split(",")
    if len(fields) <= k:
        raise RecordingError(
            f"{path}, line {number} has {len(fields)} fields, but at least {k + 1} are needed; the line is damaged."
        )
    return fields[k].strip()


_SOURCE = "RTK of a receiver in the same car"
_NOTES = (
    "There is no IMU: attitude, tilt and yaw do not apply.",
    "The data are horizontal: up is 0 in fixes and reference, so this axis has no error in RMSE and NEES.",
    "The errors of the fixes are correlated over ten seconds, which no filter in jerkbench models.",
)


@register("dataset", "beijing_car")
@dataclass(frozen=True)
class BeijingCar(FromFiles):
    """A car drive of 1156 s and 8.8 km without an IMU: fixes, velocities and sigmas at 10 Hz, and RTK as the reference.

    Each row of ``Data.txt`` has the horizontal positions (ENU, m) of the receiver and of the RTK receiver. Row i
    belongs to the i-th sentence `$PSAT,FVI` (velocity) and to the i-th sentence `$..GST` (sigmas) of ``GPSRaw.dat``.
    The up coordinate of both receivers is set to 0.

    Source: S. Wang, "Distributionally robust state estimation for jump linear systems", IEEE Trans. Signal Processing,
    2023, doi:10.1109/TSP.2023.3322802, its supplementary material ("[2] Real - Car"); for academic use and teaching.

    Attributes:
        folder: folder of Data.txt and GPSRaw.dat.
        velocity_sigma_mps: standard deviation of each axis of the velocity [m/s]. The default sigma is an assumption,
            because the receiver does not state the accuracy of velocities.
    """

    without_imu: ClassVar[bool] = True

    folder: str = ""
    velocity_sigma_mps: float = 0.1

    def __post_init__(self) -> None:
        require_positive("dataset beijing_car", self, ("velocity_sigma_mps",))

    def load(self, seed: int = 0) -> Recording:
        """Return the recording of the drive. ``seed`` has no effect.

        Raises:
            RecordingError: a file is missing or damaged, or the two files have different numbers of rows.
        """
        table, log = self.paths()
        columns, (velocity_mps, sigma_m) = read_columns((table,), TextFormat(separator="")), read_epochs(log)
        if len(columns) != len(sigma_m):
            raise RecordingError(
                f"{table} has {len(columns)} rows, but {log} has {len(sigma_m)} epochs; copy both files again."
            )
        t_s, level = columns.numbers(("Time",))[:, 0], np.zeros(len(columns))
        sigmas = sigma_m[:, :, None] * np.eye(3)
        spread = np.tile(self.velocity_sigma_mps**2 * np.eye(3), (len(columns), 1, 1))
        places, mps = (np.column_stack([columns.numbers(names), level]) for names in (RTK, RTK_VELOCITY))
        return Recording(
            name="beijing_car",
            imu=None,
            reference=Reference(t_s, _SOURCE, independent=True, enu_m=places, velocity_mps=mps),
            position=Position(t_s, np.column_stack([columns.numbers(_GPS), level]), sigmas**2),
            velocity=Velocity(t_s, np.column_stack([velocity_mps[:, :2], level]), spread),
            notes=(*columns.notes, *_NOTES),
        )

    def paths(self) -> tuple[Path, Path]:
        """Return the paths of Data.txt and GPSRaw.dat."""
        folder = Path(self.folder).expanduser()
        return find_file(folder, TABLE, ".txt", "folder"), find_file(folder, _LOG, ".dat", "folder")
