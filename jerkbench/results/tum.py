"""Trajectories in the format of the TUM benchmark: a line a pose, ``t x y z qx qy qz qw``."""

from pathlib import Path

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.errors import JerkbenchError
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import known
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
