"""The data set `journey`: recorded fixes with real errors and a better reference, as Parquet files in a folder."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from jerkbench.arrays import FloatArray, require_not_negative, require_positive
from jerkbench.errors import PluginError, RecordingError
from jerkbench.io.columns import TextFormat
from jerkbench.io.files import FromFiles, find_file, named_folder
from jerkbench.io.readers import read_columns
from jerkbench.io.sanitiser import require_origin
from jerkbench.plugins import register
from jerkbench.recording import Origin, Position, Recording, Reference, Velocity

FIXES, _REFERENCE, META = "fixes.parquet", "reference.parquet", "meta.json"
_POSITION, _SIGMA, _VELOCITY = ["e_m", "n_m", "u_m"], ["sd_e_m", "sd_n_m", "sd_u_m"], ["ve_mps", "vn_mps", "vu_mps"]

UNSTATED_M = {"UWB": 0.3, "Pixel": 5.0, "xiaomi": 5.0, "": 3.0}
"""Default standard deviation of each axis of a fix [m], by a part of the receiver's name: UWB, phones, others."""


@register("dataset", "journey")
@dataclass(frozen=True)
class RecordedFixes(FromFiles):
    """A recorded drive, walk or flight without an IMU: fixes, optional velocities and sigmas, and a reference.

    The folder has three files:

    - ``fixes.parquet`` has the columns t_s [s] and e_m, n_m, u_m (ENU) [m], and optionally the standard deviations
      sd_e_m, sd_n_m, sd_u_m [m] and the velocity ve_mps, vn_mps, vu_mps [m/s].
    - ``reference.parquet`` has the columns t_s, e_m, n_m, u_m, with t_s on the same clock as the fixes.
    - ``meta.json`` has only optional entries: group and name (which form the name of the recording), receiver (the name
      of the receiver), reference (the source of the reference), independent (whether the reference is independent of
      the fixes), origin (latitude [deg], longitude [deg], height [m]), and clock_shift_s (shift of the fixes' stamps
      [s]).

    A row is dropped if its stamp is equal to or earlier than the stamp of a previous row. For fixes without sigmas, the
    sigma depends on the name of the receiver: 0.3 m for UWB, 5 m for a phone (Pixel, xiaomi), 3 m otherwise. The notes
    of the recording state the assumed sigma. With the disturbance `score_moving`, errors are scored once per second,
    and only in motion.

    Attributes:
        folder: folder of the three files.
        position_sigma_m: standard deviation of each axis of fixes without sigmas [m], or 0 for a value that depends on
            the name of the receiver.
        velocity_sigma_mps: standard deviation of each axis of the velocity [m/s].
        clock_shift_s: time shift that is added to the stamps of fixes and velocities [s], or null for the value in
            meta.json (0 by default).
    """

    without_imu: ClassVar[bool] = True

    folder: str = ""
    position_sigma_m: float = 0.0
    velocity_sigma_mps: float = 0.1
    clock_shift_s: float | None = None

    def __post_init__(self) -> None:
        require_positive("dataset journey", self, ("velocity_sigma_mps",))
        require_not_negative("dataset journey", self, ("position_sigma_m",))
        if self.clock_shift_s is not None and not np.isfinite(self.clock_shift_s):
            raise PluginError(f"dataset journey: clock_shift_s is {self.clock_shift_s}; give a number of seconds.")

    def load(self, seed: int = 0) -> Recording:
        """Return the recording in the folder. ``seed`` has no effect.

        Raises:
            RecordingError: a file is missing or damaged, or lacks a column.
        """
        fixes, reference, meta = self.paths()
        about, rows, truth = _meta(meta), _rows(fixes), _rows(reference)
        require_origin(str(meta), tuple(about.get("origin") or ()))
        shift_s = float(about.get("clock_shift_s", 0.0)) if self.clock_shift_s is None else self.clock_shift_s
        zero_s = rows["t_s"].iloc[0]
        t_s = (rows["t_s"] - zero_s).to_numpy() + shift_s
        sigma_m, notes = self._sigmas(rows, str(about.get("receiver", "")))
        if shift_s:
            notes = (*notes, f"The stamps of the fixes are shifted by {shift_s:g} s.")
        true_s = (truth["t_s"] - zero_s).to_numpy()
        source, independent = str(about.get("reference", "not stated")), bool(about.get("independent", False))
        return Recording(
            name="/".join(str(about[key]) for key in ("group", "name") if key in about) or fixes.parent.name,
            imu=None,
            reference=Reference(true_s, source, independent, enu_m=truth[_POSITION].to_numpy()),
            position=Position(t_s, rows[_POSITION].to_numpy(), _diagonal(sigma_m**2)),
            velocity=self._velocity(rows, t_s),
            origin=Origin(*about["origin"]) if about.get("origin") else None,
            notes=("There is no IMU: attitude, tilt and yaw do not apply.", *notes),
        )

    def paths(self) -> tuple[Path, ...]:
        """Return the paths of the three files in the folder."""
        folder = named_folder(self.folder)
        return tuple(find_file(folder, name, Path(name).suffix, "folder") for name in (FIXES, _REFERENCE, META))

    def _sigmas(self, rows: pd.DataFrame, receiver: str) -> tuple[FloatArray, tuple[str, ...]]:
        """Return the standard deviations of the fixes (m, 3), and a note if they are assumed."""
        if set(_SIGMA) <= set(rows):
            return rows[_SIGMA].to_numpy(), ()
        sigma_m = self.position_sigma_m or next(default_m for part, default_m in UNSTATED_M.items() if part in receiver)
        return np.full((len(rows), 3), sigma_m), (f"The fixes have no sigma; {sigma_m:g} m per axis are used.",)

    def _velocity(self, rows: pd.DataFrame, t_s: FloatArray) -> Velocity | None:
        if not set(_VELOCITY) <= set(rows):
            return None
        variance = np.full((len(rows), 3), self.velocity_sigma_mps**2)
        return Velocity(t_s, rows[_VELOCITY].to_numpy(), _diagonal(variance))


def _diagonal(variance: FloatArray) -> FloatArray:
    """Return diagonal covariances (m, 3, 3) with the variances (m, 3)."""
    return np.asarray(variance[:, :, None] * np.eye(3))


def _rows(path: Path) -> pd.DataFrame:
    """Return the rows of a file, without rows whose stamp is equal to or earlier than a previous stamp."""
    columns = read_columns((path,), TextFormat())
    names = ["t_s", *_POSITION, *(name for name in (*_SIGMA, *_VELOCITY) if columns.has([name]))]
    rows = pd.DataFrame(columns.numbers(names), columns=names)
    return rows[rows["t_s"] > rows["t_s"].cummax().shift(fill_value=-np.inf)]


def _meta(path: Path) -> dict[str, Any]:
    try:
        about = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise RecordingError(f"{path} is not valid JSON ({error}); correct the file.") from error
    if not isinstance(about, dict):
        raise RecordingError(f"{path} does not contain a JSON object; write {{}} for a recording without metadata.")
    return about
