"""Files of a single run for other programs: its trajectory in the TUM format, its updates as CSV."""

from pathlib import Path

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import JerkbenchError
from jerkbench.estimate import Estimate, Updates
from jerkbench.evaluation.counted_rows import known
from jerkbench.files import write_text
from jerkbench.recording import Recording


def write_tum_pair(folder: Path, recording: Recording, estimate: Estimate, counted: BoolArray) -> list[Path]:
    """Write estimate.tum and reference.tum with the rows that count, in ENU, with all digits; return the files.

    The same stamps stand in both, so that an absolute position error without alignment over them is position_rmse_m. An
    angle that the reference does not know is 0 there.

    Raises:
        JerkbenchError: no row has a reference.
    """
    truth = recording.reference.enu_m
    rows = counted & known(truth, estimate)
    if truth is None or not rows.any():
        raise JerkbenchError(
            f"The recording {recording.name} has no position reference, so there is nothing to export."
        )
    where = estimate.index[rows]
    angles = recording.reference.euler_rad
    euler = np.zeros((len(where), 3)) if angles is None else np.nan_to_num(angles[where])
    t_s = recording.reference.t_s[where]
    texts = {
        "reference": _lines(t_s, truth[where], euler),
        "estimate": _lines(t_s, estimate.position_m[rows], estimate.euler_rad[rows]),
    }
    for name, text in texts.items():
        write_text(folder / f"{name}.tum", text)
    return [folder / f"{name}.tum" for name in texts]


def _lines(t_s: FloatArray, position_m: FloatArray, euler_rad: FloatArray) -> str:
    from scipy.spatial.transform import Rotation

    quaternion = Rotation.from_euler("ZYX", euler_rad[:, ::-1]).as_quat()
    table = np.column_stack([t_s, position_m, quaternion])
    return "".join(" ".join(map(repr, row)) + "\n" for row in table.tolist())


MEASURED_ROWS = tuple(
    f"{name}_{axis}_{unit}"
    for name, unit in (("position", "m"), ("velocity", "mps"))
    for axis in ("east", "north", "up")
)
"""The six rows of a measurement, with their unit."""

UPDATE_COLUMNS = (
    *("t_s", "rows", "nis", "nis_used"),
    *(f"innovation_{name}" for name in MEASURED_ROWS),
    *(f"sigma_used_{name}" for name in MEASURED_ROWS),
)


def write_updates(path: Path, updates: Updates) -> None:
    """Write a line for each update, with all digits.

    ``sigma_used`` is the square root of the diagonal of the R that was used: that of the adaptation, infinite where it
    dropped the row. What was not measured is empty. ``nis`` is of the reported R, ``nis_used`` of the used one.

    Raises:
        JerkbenchError: there is no update.
    """
    if not len(updates.t_s):
        raise JerkbenchError("The run has no update of which anything is kept, so there is nothing to write.")
    head = np.column_stack([updates.t_s, updates.rows, updates.nis, updates.nis_used])
    table = np.hstack([head, updates.innovation, np.sqrt(updates.R_diagonal)])
    lines = [",".join("" if np.isnan(value) else repr(value) for value in line) for line in table.tolist()]
    write_text(path, "\n".join([",".join(UPDATE_COLUMNS), *lines, ""]))
