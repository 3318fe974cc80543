"""The trials of the audit, domain by domain, cut where samples are missing: gyro, accelerometer, the true vertical."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.datasets.broad import ENDINGS, Broad
from jerkbench.datasets.field import Field
from jerkbench.datasets.repoimu import RepoImu
from jerkbench.geometry import vertical_in_body
from jerkbench.io.files import fingerprint
from jerkbench.recording import Imu, Recording, Reference

DOMAINS = {
    "broad": "BROAD, hand",
    "tstick": "TStick, hand",
    "kitti": "KITTI, vehicle",
    "field": "simulated field, vehicle",
}
"""What each is called; they are never pooled."""

DRIVES = 16
"""Seeds of the simulated field."""

GAP_S = 0.1
"""Every recording is cut where the IMU is silent for longer, for all methods alike."""

LEAST_S = 5.0
"""Shorter pieces do not count."""

STILL_MPS = 0.1

Piece = tuple[Recording, FloatArray, BoolArray]
"""A part of a recording, its true verticals (n, 3), and which samples count (n,)."""


@dataclass(frozen=True)
class TiltTrial:
    """One recording.

    Attributes:
        domain: one of `DOMAINS`.
        name: of the recording.
        fingerprint: of its file; empty: it is simulated.
        pieces: reads or simulates it.
    """

    domain: str
    name: str
    fingerprint: str
    pieces: Callable[[], list[Piece]]


def all_trials(folder: Path) -> list[TiltTrial]:
    """Return the trials of ``folder``/broad, repoimu and kitti that are there, and the simulated drives."""
    return [*broad(folder / "broad"), *tstick(folder / "repoimu"), *kitti(folder / "kitti"), *field()]


def broad(folder: Path) -> Iterator[TiltTrial]:
    """The trials of BROAD that are there."""
    for path in sorted(path for path in folder.glob("*_*") if path.suffix in ENDINGS):
        yield TiltTrial("broad", path.stem, fingerprint((path,)), partial(_of_broad, path))


def tstick(folder: Path) -> Iterator[TiltTrial]:
    """The trials of RepoIMU's TStick that are there."""
    for path in sorted(folder.glob("TStick_*.parquet")):
        yield TiltTrial("tstick", path.stem, fingerprint((path,)), partial(_of_tstick, path))


def kitti(folder: Path) -> Iterator[TiltTrial]:
    """The drives of KITTI: t; ax, ay, az; gx, gy, gz; e, n, u; ve, vn, vu; roll, pitch, yaw. All counts."""
    for path in sorted(folder.glob("*drive*.parquet")):
        yield TiltTrial("kitti", path.stem, fingerprint((path,)), partial(_of_kitti, path))


def field() -> Iterator[TiltTrial]:
    """Drives of the simulated field."""
    for seed in range(DRIVES):
        yield TiltTrial("field", f"seed {seed:02d}", "", partial(_of_field, seed))


def _of_broad(path: Path) -> list[Piece]:
    return _whole(Broad(str(path.parent), int(path.name[:2])).load())


def _of_tstick(path: Path) -> list[Piece]:
    _, test, trial = path.stem.split("_")
    return _whole(RepoImu(str(path.parent), int(test[4:]), int(trial[5:])).load())


def _of_field(seed: int) -> list[Piece]:
    return _whole(Field().load(seed))


def _whole(recording: Recording) -> list[Piece]:
    """A recording without gaps."""
    euler_rad = np.asarray(recording.reference.euler_rad, dtype=np.float64)
    return [(recording, vertical_in_body(np.nan_to_num(euler_rad)), recording.reference.scored)]


def _of_kitti(path: Path) -> list[Piece]:
    drive = pd.read_parquet(path).astype(float)
    edges = [0, *(np.flatnonzero(np.diff(drive["t"]) > GAP_S) + 1), len(drive)]
    parts = [drive.iloc[begin:end] for begin, end in pairwise(edges)]
    return [_part(path.stem, part) for part in parts if np.ptp(part["t"]) >= LEAST_S]


def _part(name: str, part: pd.DataFrame) -> Piece:
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
