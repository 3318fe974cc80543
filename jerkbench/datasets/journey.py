"""A real journey as a folder: fixes that are wrong as real ones are, and a better reference, as Parquet."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from jerkbench.arrays import FloatArray, require_not_negative, require_positive
from jerkbench.errors import PluginError, RecordingError
from jerkbench.io.columns import read_columns
from jerkbench.io.files import FromFiles, find_file, named_folder
from jerkbench.io.sanitiser import require_origin
from jerkbench.io.text import TextFormat
from jerkbench.plugins import register
from jerkbench.recording import Origin, Position, Recording, Reference, Velocity

FIXES, _REFERENCE, META = "fixes.parquet", "reference.parquet", "meta.json"
_PLACE, _SIGMA, _VELOCITY = ["e_m", "n_m", "u_m"], ["sd_e_m", "sd_n_m", "sd_u_m"], ["ve_mps", "vn_mps", "vu_mps"]

UNSTATED_M = {"UWB": 0.3, "Pixel": 5.0, "xiaomi": 5.0, "": 3.0}
"""One sigma of an axis by a word of the receiver's name: of UWB, of phones, of single-point fixes."""


@register("dataset", "journey")
@dataclass(frozen=True)
class RealJourney(FromFiles):
    """A real journey: fixes, where known with velocities and sigmas, and a better reference; no IMU.

    The folder has three files:

    - ``fixes.parquet``: t_s [s]; e_m, n_m, u_m [m], ENU; where known sd_e_m, sd_n_m, sd_u_m [m] and ve_mps, vn_mps,
      vu_mps;
    - ``reference.parquet``: t_s, e_m, n_m, u_m on the same clock;
    - ``meta.json``: all optional: group and name (what tables call it), receiver, reference (where it comes from),
      independent (whether it shares nothing with the fixes), origin (latitude [deg], longitude [deg], height [m]),
      clock_shift_s.

    A row whose stamp repeats is left out. Where no sigma is stated, one is taken by the name of the receiver: 0.3 m for
    UWB, 5 m for a phone (Pixel, xiaomi), 3 m for any other. The recording's notes say which. Give the disturbance
    `score_moving` to count errors once a second, and only while the vehicle moves.

    Attributes:
        folder: where the three files are.
        position_sigma_m: one standard deviation of an axis, where the fixes state none; 0: as above.
        velocity_sigma_mps: one standard deviation of an axis of the velocity.
        clock_shift_s: added to the stamps of fixes and velocities; null: that of meta.json, or 0.
    """

    without_imu: ClassVar[bool] = True

    folder: str = ""
    position_sigma_m: float = 0.0
    velocity_sigma_mps: float = 0.1
    clock_shift_s: float | None = None

    def __post_init__(self) -> None:
        """Check the sigmas and the shift."""
        require_positive("dataset journey", self, ("velocity_sigma_mps",))
        require_not_negative("dataset journey", self, ("position_sigma_m",))
        if self.clock_shift_s is not None and not np.isfinite(self.clock_shift_s):
            raise PluginError(f"dataset journey: clock_shift_s is {self.clock_shift_s}; give a number of seconds.")

    def load(self, seed: int = 0) -> Recording:
        """Return the journey; ``seed`` changes nothing.

        Raises:
            RecordingError: a file is missing or damaged, or lacks a column.
        """
        fixes, reference, meta = self.paths()
        about, rows, truth = _meta(meta), _rows(fixes), _rows(reference)
        require_origin("meta.json of a journey", tuple(about.get("origin") or ()))
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
            reference=Reference(true_s, source, independent, enu_m=truth[_PLACE].to_numpy()),
            position=Position(t_s, rows[_PLACE].to_numpy(), _diagonal(sigma_m**2)),
            velocity=self._velocity(rows, t_s),
            origin=Origin(*about["origin"]) if about.get("origin") else None,
            notes=("There is no IMU: attitude, tilt and yaw do not apply.", *notes),
        )

    def paths(self) -> tuple[Path, ...]:
        """Return the files that are read."""
        folder = named_folder(self.folder)
        return tuple(find_file(folder, name, Path(name).suffix, "folder") for name in (FIXES, _REFERENCE, META))

    def _sigmas(self, rows: pd.DataFrame, receiver: str) -> tuple[FloatArray, tuple[str, ...]]:
        """Return one sigma of each axis of each fix (m, 3), and what has to be known of it."""
        if set(_SIGMA) <= set(rows):
            return rows[_SIGMA].to_numpy(), ()
        sigma_m = self.position_sigma_m or next(own for word, own in UNSTATED_M.items() if word in receiver)
        return np.full((len(rows), 3), sigma_m), (f"The fixes state no sigma; {sigma_m:g} m an axis are taken.",)

    def _velocity(self, rows: pd.DataFrame, t_s: FloatArray) -> Velocity | None:
        if not set(_VELOCITY) <= set(rows):
            return None
        variance = np.full((len(rows), 3), self.velocity_sigma_mps**2)
        return Velocity(t_s, rows[_VELOCITY].to_numpy(), _diagonal(variance))


def _diagonal(variance: FloatArray) -> FloatArray:
    """Return covariances (m, 3, 3) of variances (m, 3)."""
    return np.asarray(variance[:, :, None] * np.eye(3))


def _rows(path: Path) -> pd.DataFrame:
    """Return the rows of a file whose stamps increase."""
    columns = read_columns((path,), TextFormat())
    if not len(columns):
        raise RecordingError(f"{path} has no rows; a journey has one for each fix.")
    names = ["t_s", *_PLACE, *(name for name in (*_SIGMA, *_VELOCITY) if columns.has([name]))]
    rows = pd.DataFrame(columns.numbers(names), columns=names)
    return rows[rows["t_s"] > rows["t_s"].cummax().shift(fill_value=-np.inf)]


def _meta(path: Path) -> dict[str, Any]:
    try:
        about = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise RecordingError(f"{path} is no JSON ({error}).") from error
    if not isinstance(about, dict):
        raise RecordingError(f"{path} holds no JSON object; write {{}} where nothing is known.")
    return about
