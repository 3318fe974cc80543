"""The trials of the audit of attitude filters, domain by domain, and the rows of every method on them.

Recordings are cut where samples are missing: gyro, accelerometer, the true vertical.
"""

import hashlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.attitude.alignment import TRACK_S
from jerkbench.attitude.common import TiltAndYaw
from jerkbench.attitude.vqf import SILENCE_S, OfflineVqf
from jerkbench.audit.tilt_methods import AS_THEY_COME, TILT_METHODS, TILT_SETTINGS
from jerkbench.datasets.broad import ENDINGS, Broad, RepoImu
from jerkbench.datasets.field import Field
from jerkbench.evaluation.counted_rows import angle_between
from jerkbench.files import write_atomically
from jerkbench.geometry import vertical_in_body
from jerkbench.io.files import fingerprint
from jerkbench.jobs.cluster import Workers
from jerkbench.jobs.dispatch import each_result
from jerkbench.jobs.key import code_digest, versions
from jerkbench.jobs.progress import Progress
from jerkbench.recording import Imu, Recording, Reference, Velocity

DOMAINS = {
    "broad": "BROAD, hand",
    "tstick": "TStick, hand",
    "kitti": "KITTI, vehicle",
    "kitti_start": "KITTI, vehicle, start known",
    "field": "simulated field, vehicle",
}
"""What each is called; they are never pooled."""

DRIVES = 16
"""Seeds of the simulated field."""

LEAST_S = 5.0
"""Shorter pieces do not count."""

RESTING_MPS = 0.1

VELOCITY_SIGMA_MPS, VELOCITY_EVERY = 0.1, 10
"""White noise of the velocities for a known start, and the samples from one to the next."""

TiltPiece = tuple[Recording, FloatArray, BoolArray]
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
    pieces: Callable[[], list[TiltPiece]]

    @property
    def alignment(self) -> str:
        """The start of every method; empty: its own."""
        return "track" if self.domain == "kitti_start" else ""


def all_trials(folder: Path) -> Iterator[TiltTrial]:
    """The trials of ``folder``/broad, repoimu and kitti that are there, and the simulated drives."""
    for path in sorted(path for path in (folder / "broad").glob("*_*") if path.suffix in ENDINGS):
        recording = Broad(str(path.parent), int(path.name[:2]))
        yield TiltTrial("broad", path.stem, recording.fingerprint(), partial(_whole, recording, 0))
    for path in sorted((folder / "repoimu").glob("TStick_*.parquet")):
        _, test, trial = path.stem.split("_")
        stick = RepoImu(str(path.parent), int(test[4:]), int(trial[5:]))
        yield TiltTrial("tstick", path.stem, stick.fingerprint(), partial(_whole, stick, 0))
    drives = sorted((folder / "kitti").glob("*drive*.parquet"))
    for number, path in enumerate(drives):
        yield TiltTrial("kitti", path.stem, fingerprint((path,)), partial(kitti_pieces, path, number))
    for number, path in enumerate(drives):
        if after_start(path, number):
            yield TiltTrial("kitti_start", path.stem, fingerprint((path,)), partial(after_start, path, number))
    for seed in range(DRIVES):
        yield TiltTrial("field", f"seed {seed:02d}", "", partial(_whole, Field(), seed))


def _whole(source: Broad | RepoImu | Field, seed: int) -> list[TiltPiece]:
    """A recording without gaps."""
    recording = source.load(seed)
    euler_rad = np.asarray(recording.reference.euler_rad, dtype=np.float64)
    return [(recording, vertical_in_body(np.nan_to_num(euler_rad)), recording.reference.scored)]


def kitti_pieces(path: Path, seed: int) -> list[TiltPiece]:
    """The pieces of a drive: t; ax, ay, az; gx, gy, gz; e, n, u; ve, vn, vu; roll, pitch, yaw. All counts."""
    drive = pd.read_parquet(path).astype(float)
    edges = [0, *(np.flatnonzero(np.diff(drive["t"]) > SILENCE_S) + 1), len(drive)]
    parts = [drive.iloc[begin:end] for begin, end in pairwise(edges)]
    return [_part(path.stem, part, seed) for part in parts if np.ptp(part["t"]) >= LEAST_S]


def after_start(path: Path, seed: int) -> list[TiltPiece]:
    """The pieces of a drive without their first seconds, which an alignment by the track takes."""
    return [
        (piece, truth, piece.inertial.t_s >= TRACK_S)
        for piece, truth, _ in kitti_pieces(path, seed)
        if piece.inertial.t_s[-1] >= TRACK_S + LEAST_S
    ]


def _part(name: str, part: pd.DataFrame, seed: int) -> TiltPiece:
    """A part of a drive; it is at rest at the start as long as its speed says."""
    t_s = (part["t"] - part["t"].iloc[0]).to_numpy()
    accel, gyro, place, velocity, euler = (
        part[names.split()].to_numpy() for names in ("ax ay az", "gx gy gz", "e n u", "ve vn vu", "roll pitch yaw")
    )
    moving = np.linalg.norm(velocity, axis=1) > RESTING_MPS
    rest_s = float(t_s[np.argmax(moving)]) if moving.any() else float(t_s[-1])
    reference = Reference(
        t_s,
        "the OXTS's own fused solution",
        independent=False,
        enu_m=place,
        velocity_mps=velocity,
        euler_rad=euler,
    )
    measured = with_noise(t_s, velocity, seed)
    recording = Recording(name, Imu(t_s, accel, gyro), reference, velocity=measured, static_start_s=rest_s)
    return recording, vertical_in_body(euler), np.ones(len(t_s), dtype=np.bool_)


def with_noise(t_s: FloatArray, mps: FloatArray, seed: int) -> Velocity:
    """Return ten velocities a second of (n, 3) at 100 Hz, with white noise: what shows a known start."""
    at = np.arange(0, len(t_s), VELOCITY_EVERY)
    noise = VELOCITY_SIGMA_MPS * np.random.default_rng(seed).normal(size=(len(at), 3))
    return Velocity(t_s[at], mps[at] + noise, np.tile(VELOCITY_SIGMA_MPS**2 * np.eye(3), (len(at), 1, 1)))


# Every setting of every method on every trial: the rows of the audit, kept trial by trial.

COMPUTED_BY = ("audit/tilt_methods", "audit/tilt_trials")
"""Modules that the rows depend on, besides those of every run."""

TILT_COLUMNS = ("domain", "trial", "method", "setting", "inclination_rmse_deg")
"""Of the rows; the setting -1 is the method as it comes."""


def error_deg(plugin: TiltAndYaw, pieces: Sequence[TiltPiece]) -> float:
    """Return the RMSE of the inclination over all pieces that count [deg]."""
    squares, count = 0.0, 0
    for recording, truth, counted in pieces:
        x, _ = plugin.verticals(recording)
        squares += float((angle_between(x[counted], truth[counted]) ** 2).sum())
        count += int(counted.sum())
    return float(np.degrees(np.sqrt(squares / count)))


def trial_rows(trial: TiltTrial, count: int = TILT_SETTINGS) -> pd.DataFrame:
    """Return the rows of a trial: each method as it comes, and at the first ``count`` of its settings."""
    rows = [(trial.domain, trial.name, *row) for row in _of_methods(trial, count)]
    return pd.DataFrame(rows, columns=TILT_COLUMNS).astype({"inclination_rmse_deg": "float32", "setting": "int16"})


def _of_methods(trial: TiltTrial, count: int) -> Iterator[tuple[str, int, float]]:
    pieces = trial.pieces()
    rate_hz = 1.0 / pieces[0][0].inertial.nominal_interval_s
    for name, plugin in AS_THEY_COME.items():
        fixed = not trial.alignment or isinstance(plugin, OfflineVqf)  # a smoother finds its start itself
        yield name, -1, error_deg(plugin if fixed else replace(plugin, alignment=trial.alignment), pieces)
    for name, method in TILT_METHODS.items():
        for number, setting in enumerate(method.settings()[:count]):
            yield name, number, error_deg(method.plugin(setting, rate_hz, trial.alignment), pieces)


def audit_rows(trials: Sequence[TiltTrial], folder: Path, workers: int, count: int = TILT_SETTINGS) -> pd.DataFrame:
    """Return the rows of all trials; those that are in ``folder`` already, of this code and these data, are taken.

    Raises:
        JerkbenchError: a trial is damaged, or a package is not installed.
    """
    paths = {_part_path(trial, folder, count): trial for trial in trials}
    left = {path: trial for path, trial in paths.items() if not path.is_file()}
    bar = Progress(len(paths), len(paths) - len(left), doing="Attitude filters", unit="trials")
    with bar, Workers(count=workers) as own:
        for _ in each_result(partial(_keep, count=count), list(left.items()), own):
            bar.advance()
    return pd.concat([pd.read_parquet(path) for path in paths], ignore_index=True)


def _keep(left: tuple[Path, TiltTrial], count: int) -> None:
    """Run a trial, and store its rows."""
    path, trial = left
    rows = trial_rows(trial, count)
    write_atomically(path, lambda partial: rows.to_parquet(partial, index=False))


def _part_path(trial: TiltTrial, folder: Path, count: int) -> Path:
    """The file of a trial's rows: its name tells code, libraries and data apart."""
    parts = [code_digest(*COMPUTED_BY), *versions().values(), version("vqf"), trial.fingerprint, str(count)]
    digest = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]
    return folder / f"{trial.domain}-{trial.name.replace(' ', '-')}-{digest}.parquet"
