"""The attitude filters of an audit with the settings that each may be tuned to; trials, and the rows of all on them.

Every number is drawn from the range of its plugin (`jerkbench show`), on its scale; every switch is drawn as well: the
estimate of the gyro's bias, and how a vehicle in motion starts. Noise is a density and a window is a time, so that a
setting means the same at 100 and at 286 Hz. The defaults are not among the settings: some were tuned on these trials.

Recordings are cut where samples are missing: gyro, accelerometer, the true vertical.
"""

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.attitude.common import TRACK_S, TiltAndYaw
from jerkbench.attitude.gyro_only import GyroOnly
from jerkbench.attitude.madgwick import Madgwick
from jerkbench.attitude.mahony import Mahony
from jerkbench.attitude.mekf import Mekf
from jerkbench.attitude.tilt import Tilt
from jerkbench.attitude.vqf import SILENCE_S, OfflineVqf, Vqf
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
from jerkbench.parameters import SWITCH, Range, ranges_of
from jerkbench.recording import Imu, Recording, Reference, Velocity
from jerkbench.tuning.space import Sobol

TiltSetting = Mapping[str, float]
"""Values of the ranges, and 0 or 1 of the switches."""

TILT_SETTINGS = 64
"""Tried of each method, on every trial."""


@dataclass(frozen=True)
class TiltMethod:
    """An attitude filter with what may be tuned of it.

    Attributes:
        ranges: of its numbers.
        switches: names of those, besides ``gravity``: a start in motion is the accelerometer's first second, or level.
        make: the plugin of a setting, at a number of samples a second, with an alignment.
    """

    ranges: Mapping[str, Range]
    switches: tuple[str, ...]
    make: Callable[[TiltSetting, float, str], TiltAndYaw]

    def plugin(self, setting: TiltSetting, rate_hz: float, alignment: str = "") -> TiltAndYaw:
        """Return the plugin of a setting; an ``alignment`` that is given replaces that of the setting."""
        return self.make(setting, rate_hz, alignment or ("gravity" if setting["gravity"] else "rest"))

    def settings(self) -> list[TiltSetting]:
        """Return the first points of a scrambled Sobol sequence, with all switches."""
        names = [*self.ranges, *self.switches, "gravity"]
        points = Sobol(len(names), 0).ask(TILT_SETTINGS)
        return [{name: self._value(name, share) for name, share in zip(names, point, strict=True)} for point in points]

    def _value(self, name: str, share: float) -> float:
        return self.ranges[name].value(float(share)) if name in self.ranges else float(share >= 0.5)


def _numbers(cls: type, *names: str) -> dict[str, Range]:
    """The ranges of ``names``; of all parameters but the switches, where none is named."""
    ranges = ranges_of(cls).items()
    return {name: bounds for name, bounds in ranges if bounds is not SWITCH and (name in names or not names)}


def _tilt(adapt: str, *names: str) -> TiltMethod:
    """The paper's filter; its noise of a sample follows from the density, and its window from the time."""

    def make(setting: TiltSetting, rate_hz: float, alignment: str) -> Tilt:
        return Tilt(
            adapt,
            setting["gyro_density"] * np.sqrt(rate_hz),
            setting["accel_density"] * np.sqrt(rate_hz),
            setting.get("external_memory", 0.0),
            max(1, round(setting.get("window_s", 0.0) * rate_hz)),
            propagation="exact",
            alignment=alignment,
        )

    return TiltMethod(_numbers(Mekf, "gyro_density", "accel_density", *names), (), make)


def _as_it_stands(base: TiltAndYaw, *names: str, switches: tuple[str, ...] = ()) -> TiltMethod:
    """A filter whose parameters ``names`` (of none: all with a range) and ``switches`` are those of the setting."""
    numbers = _numbers(type(base), *names)

    def make(setting: TiltSetting, _: float, alignment: str) -> TiltAndYaw:
        own: Any = {name: setting[name] for name in numbers} | {name: bool(setting[name]) for name in switches}
        return replace(base, **own, alignment=alignment)

    return TiltMethod(numbers, switches, make)


def _mahony(setting: TiltSetting, _: float, alignment: str) -> Mahony:
    integral = setting["integral_per_s2"] if setting["bias"] else 0.0
    return Mahony(setting["proportional_per_s"], integral, alignment=alignment)


DENSITIES = ("gyro_density", "accel_density", "bias_density")

TILT_METHODS = {
    "constant": _tilt("none"),
    "mtf": _tilt("mtf", "window_s"),
    "lee": _tilt("lee", "external_memory"),
    "mekf": _as_it_stands(Mekf("none"), *DENSITIES, switches=("bias",)),
    "mekf_mtf": _as_it_stands(Mekf("mtf"), *DENSITIES, "window_s", switches=("bias",)),
    "mekf_lee": _as_it_stands(Mekf("lee"), *DENSITIES, "window_s", "external_memory", switches=("bias",)),
    "madgwick": _as_it_stands(Madgwick()),
    "mahony": TiltMethod(_numbers(Mahony), ("bias",), _mahony),
    "vqf": _as_it_stands(Vqf(), switches=("rest_bias", "motion_bias")),
}
"""Those that are tuned and ranked."""

AS_THEY_COME = {
    "constant, default": Tilt("none", sigma_accel_mps2=2.0, propagation="exact"),
    "mtf, default": Tilt("mtf", sigma_accel_mps2=0.5, propagation="exact"),
    "lee, default": Tilt("lee", 0.1, 10.0, 0.3, propagation="exact"),
    "mekf, default": Mekf(),
    "mekf_mtf, default": Mekf("mtf"),
    "mekf_lee, default": Mekf("lee"),
    "madgwick, default": Madgwick(),
    "mahony, default": Mahony(),
    "vqf, default": Vqf(),
    "gyro_only": GyroOnly(),
    "offline_vqf": OfflineVqf(),
}
"""Not tuned; offline_vqf is a smoother, shown and never ranked."""

# The trials, domain by domain.

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
    told = {"enu_m": place, "velocity_mps": velocity, "euler_rad": euler}
    reference = Reference(t_s, "the OXTS's own fused solution", independent=False, **told)
    measured = with_noise(t_s, velocity, seed)
    recording = Recording(name, Imu(t_s, accel, gyro), reference, velocity=measured, static_start_s=rest_s)
    return recording, vertical_in_body(euler), np.ones(len(t_s), dtype=np.bool_)


def with_noise(t_s: FloatArray, mps: FloatArray, seed: int) -> Velocity:
    """Return ten velocities a second of (n, 3) at 100 Hz, with white noise: what shows a known start."""
    at = np.arange(0, len(t_s), VELOCITY_EVERY)
    noise = VELOCITY_SIGMA_MPS * np.random.default_rng(seed).normal(size=(len(at), 3))
    return Velocity(t_s[at], mps[at] + noise, np.tile(VELOCITY_SIGMA_MPS**2 * np.eye(3), (len(at), 1, 1)))


# Every setting of every method on every trial: the rows of the audit, kept trial by trial.

COMPUTED_BY = ("audit/tilt_trials",)
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
