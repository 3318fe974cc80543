"""The trials of the three domains, cut where samples are missing: gyro, accelerometer, and the true vertical."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.datasets.broad import Broad
from jerkbench.datasets.repoimu import RepoImu
from jerkbench.geometry import vertical_in_body
from jerkbench.recording import Imu, Recording, Reference

GAP_S = 0.1
"""Every recording is cut where the IMU is silent for longer, for all methods alike."""

LEAST_S = 5.0
"""Shorter pieces do not count."""

STILL_MPS = 0.1


@dataclass(frozen=True)
class Trial:
    """One recording.

    Attributes:
        domain: broad, tstick or kitti.
        name: of the recording.
        pieces: of it, each with its true verticals (n, 3), and which samples count (n,).
    """

    domain: str
    name: str
    pieces: tuple[tuple[Recording, FloatArray, BoolArray], ...]

    @property
    def rate_hz(self) -> float:
        """Samples a second."""
        return 1.0 / self.pieces[0][0].inertial.nominal_interval_s


def all_trials(folder: Path) -> list[Trial]:
    """Return the trials of ``folder``/broad, repoimu and kitti."""
    return [*broad(folder / "broad"), *tstick(folder / "repoimu"), *kitti(folder / "kitti")]


def broad(folder: Path) -> Iterator[Trial]:
    """The trials of BROAD that are there."""
    for path in sorted([*folder.glob("*.hdf5"), *folder.glob("*.mat")]):
        yield whole("broad", Broad(str(folder), int(path.name[:2])).load())


def tstick(folder: Path) -> Iterator[Trial]:
    """The trials of RepoIMU's TStick that are there."""
    for path in sorted(folder.glob("TStick_*.parquet")):
        _, test, trial = path.stem.split("_")
        yield whole("tstick", RepoImu(str(folder), int(test[4:]), int(trial[5:])).load())


def whole(domain: str, recording: Recording) -> Trial:
    """A recording without gaps."""
    euler_rad = np.asarray(recording.reference.euler_rad, dtype=np.float64)
    truth = vertical_in_body(np.nan_to_num(euler_rad))
    return Trial(domain, recording.name, ((recording, truth, recording.reference.scored),))


def kitti(folder: Path) -> Iterator[Trial]:
    """The drives of KITTI: t; ax, ay, az; gx, gy, gz; e, n, u; ve, vn, vu; roll, pitch, yaw. All counts."""
    for path in sorted(folder.glob("*drive*.parquet")):
        drive = pd.read_parquet(path).astype(float)
        edges = [0, *(np.flatnonzero(np.diff(drive["t"]) > GAP_S) + 1), len(drive)]
        parts = [drive.iloc[begin:end] for begin, end in pairwise(edges)]
        pieces = tuple(piece(path.stem, part) for part in parts if np.ptp(part["t"]) >= LEAST_S)
        yield Trial("kitti", path.stem, pieces)


def piece(name: str, part: pd.DataFrame) -> tuple[Recording, FloatArray, BoolArray]:
    """A part of a drive; it is at rest at the start as long as its speed says."""
    t_s = (part["t"] - part["t"].iloc[0]).to_numpy()
    accel, gyro, place, velocity, euler = (
        part[names.split()].to_numpy() for names in ("ax ay az", "gx gy gz", "e n u", "ve vn vu", "roll pitch yaw")
    )
    moving = np.linalg.norm(velocity, axis=1) > STILL_MPS
    rest_s = float(t_s[np.argmax(moving)]) if moving.any() else float(t_s[-1])
    solution = {"enu_m": place, "velocity_mps": velocity, "euler_rad": euler}
    reference = Reference(t_s, "the OXTS's own fused solution", independent=False, **solution)
    recording = Recording(name, Imu(t_s, accel, gyro), reference, static_start_s=rest_s)
    return recording, vertical_in_body(euler), np.ones(len(t_s), dtype=np.bool_)
