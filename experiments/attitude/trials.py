"""The attitude filters of the study, their settings, and the trials; the error of each filter on each trial.

Every parameter takes values from the range of its plugin (`jerkbench show`). The switches are the estimate of the
gyro's bias, and the start of a vehicle in motion. Noise is a density and a window is a time, so that a setting means
the same at 100 Hz and at 286 Hz. The defaults are not among the settings, because some were tuned on these trials.

Recordings are cut where samples are missing, so that a trial consists of one or several recordings.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.stats.qmc import Sobol

from jerkbench import api
from jerkbench.arrays import FloatArray
from jerkbench.attitude.common import TRACK_S, TiltAndYaw
from jerkbench.attitude.mahony import Madgwick, Mahony
from jerkbench.attitude.mekf import Mekf
from jerkbench.attitude.reference import GyroOnly
from jerkbench.attitude.tilt import Tilt
from jerkbench.attitude.vqf import SILENCE_S, OfflineVqf, Vqf
from jerkbench.datasets.broad import SATURATED_RADPS
from jerkbench.parameters import SWITCH, Range, ranges_of
from jerkbench.recording import Imu, Recording, Reference, Velocity

Setting = Mapping[str, float]
"""Values of the ranges, and 0 or 1 of the switches."""

SETTINGS = 64
"""Tried of each method, on every trial."""


@dataclass(frozen=True)
class Method:
    """An attitude filter with what may be tuned of it.

    Attributes:
        ranges: of its numbers.
        switches: names of those, besides ``gravity``: a start in motion is the accelerometer's first second, or level.
        make: the plugin of a setting, at a number of samples a second, with an alignment.
    """

    ranges: Mapping[str, Range]
    switches: tuple[str, ...]
    make: Callable[[Setting, float, str], TiltAndYaw]

    def plugin(self, setting: Setting, rate_hz: float, alignment: str = "") -> TiltAndYaw:
        """Return the plugin of a setting; an ``alignment`` that is given replaces that of the setting."""
        return self.make(setting, rate_hz, alignment or ("gravity" if setting["gravity"] else "rest"))

    def settings(self) -> list[Setting]:
        """Return the first points of a scrambled Sobol sequence, with all switches."""
        names = [*self.ranges, *self.switches, "gravity"]
        points = Sobol(len(names), bits=30, rng=np.random.default_rng(0)).random(SETTINGS)
        return [{name: self._value(name, share) for name, share in zip(names, point, strict=True)} for point in points]

    def _value(self, name: str, share: float) -> float:
        return self.ranges[name].value(float(share)) if name in self.ranges else float(share >= 0.5)


def _numbers(cls: type, *names: str) -> dict[str, Range]:
    """The ranges of ``names``; of all parameters but the switches, where none is named."""
    ranges = ranges_of(cls).items()
    return {name: bounds for name, bounds in ranges if bounds is not SWITCH and (name in names or not names)}


def _tilt(adapt: str, *names: str) -> Method:
    """The paper's filter; its noise of a sample follows from the density, and its window from the time."""

    def make(setting: Setting, rate_hz: float, alignment: str) -> Tilt:
        return Tilt(
            adapt,
            setting["gyro_density"] * np.sqrt(rate_hz),
            setting["accel_density"] * np.sqrt(rate_hz),
            setting.get("external_memory", 0.0),
            max(1, round(setting.get("window_s", 0.0) * rate_hz)),
            propagation="exact",
            alignment=alignment,
        )

    return Method(_numbers(Mekf, "gyro_density", "accel_density", *names), (), make)


def _as_it_stands(base: TiltAndYaw, *names: str, switches: tuple[str, ...] = ()) -> Method:
    """A filter whose parameters ``names`` (of none: all with a range) and ``switches`` are those of the setting."""
    numbers = _numbers(type(base), *names)

    def make(setting: Setting, _: float, alignment: str) -> TiltAndYaw:
        own: Any = {name: setting[name] for name in numbers} | {name: bool(setting[name]) for name in switches}
        return replace(base, **own, alignment=alignment)

    return Method(numbers, switches, make)


def _mahony(setting: Setting, _: float, alignment: str) -> Mahony:
    integral = setting["integral_per_s2"] if setting["bias"] else 0.0
    return Mahony(setting["proportional_per_s"], integral, alignment=alignment)


DENSITIES = ("gyro_density", "accel_density", "bias_density")

METHODS = {
    "constant": _tilt("none"),
    "mtf": _tilt("mtf", "window_s"),
    "lee": _tilt("lee", "external_memory"),
    "mekf": _as_it_stands(Mekf("none"), *DENSITIES, switches=("bias",)),
    "mekf_mtf": _as_it_stands(Mekf("mtf"), *DENSITIES, "window_s", switches=("bias",)),
    "mekf_lee": _as_it_stands(Mekf("lee"), *DENSITIES, "window_s", "external_memory", switches=("bias",)),
    "madgwick": _as_it_stands(Madgwick()),
    "mahony": Method(_numbers(Mahony), ("bias",), _mahony),
    "vqf": _as_it_stands(Vqf(), switches=("rest_bias", "motion_bias")),
}
"""Those that are tuned and ranked."""

DEFAULTS = {
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

SESSIONS = {
    "broad": r"\d+_(.+?)(?:_[A-C]|_\dcm)?$",
    "tstick": r"TStick_(Test\d+)",
    "kitti": r"(\d{4}_\d\d_\d\d)",
    "kitti_start": r"(\d{4}_\d\d_\d\d)",
}
"""Session in the name of a trial: the motion and condition, the number of the test, or the day of the recording."""


def session_of(domain: str, name: str) -> str:
    """Return the session of a trial. Without a pattern or a match, each trial is a session."""
    match = re.match(SESSIONS.get(domain, "(.*)"), name)
    return match[1] if match else name


GYRO_LIMITS_RADPS = {"tstick": SATURATED_RADPS}
"""Angular rate above which a sample is saturated. In the other domains, the gyro does not saturate."""

DRIVES = 16
"""Seeds of the simulated field."""

MIN_PIECE_S = 5.0
"""Shorter pieces do not count."""

RESTING_MPS = 0.1

VELOCITY_SIGMA_MPS, VELOCITY_EVERY = 0.1, 10
"""White noise of the velocities for a known start, and the samples from one to the next."""


@dataclass(frozen=True)
class Trial:
    """One trial.

    Attributes:
        domain: one of `DOMAINS`.
        name: of the recording.
        recordings: reads or simulates it, in pieces without gaps.
    """

    domain: str
    name: str
    recordings: Callable[[], list[Recording]]

    @property
    def start_is_known(self) -> bool:
        """Whether every filter starts with the vertical that the gyro and the velocities of the first seconds show."""
        return self.domain == "kitti_start"


def all_trials(folder: Path) -> Iterator[Trial]:
    """The trials in ``folder``/broad, repoimu and kitti, as far as these are there, and the simulated drives."""
    for path in sorted(path for path in (folder / "broad").glob("*_*") if path.suffix in (".mat", ".hdf5")):
        yield _of("broad", path.stem, {"name": "broad", "folder": str(path.parent), "trial": int(path.name[:2])})
    for path in sorted((folder / "repoimu").glob("TStick_*.parquet")):
        _, test, trial = path.stem.split("_")
        numbers = {"test": int(test[4:]), "trial": int(trial[5:])}
        yield _of("tstick", path.stem, {"name": "repoimu", "folder": str(path.parent), **numbers})
    drives = sorted((folder / "kitti").glob("*drive*.parquet"))
    for number, path in enumerate(drives):
        yield Trial("kitti", path.stem, partial(kitti_pieces, path, number))
    for number, path in enumerate(drives):
        if after_start(path, number):
            yield Trial("kitti_start", path.stem, partial(after_start, path, number))
    for seed in range(DRIVES):
        yield _of("field", f"seed {seed:02d}", "field", seed)


def _of(domain: str, name: str, dataset: api.Part, seed: int = 0) -> Trial:
    """A trial without gaps, of a data set of jerkbench."""
    return Trial(domain, name, partial(_loaded, dataset, seed))


def _loaded(dataset: api.Part, seed: int) -> list[Recording]:
    return [api.load(dataset, seed)]


def kitti_pieces(path: Path, seed: int) -> list[Recording]:
    """The pieces of a drive: t; ax, ay, az; gx, gy, gz; e, n, u; ve, vn, vu; roll, pitch, yaw."""
    drive = pd.read_parquet(path).astype(float)
    edges = [0, *(np.flatnonzero(np.diff(drive["t"]) > SILENCE_S) + 1), len(drive)]
    parts = [drive.iloc[begin:end] for begin, end in pairwise(edges)]
    return [_part(path.stem, part, seed) for part in parts if np.ptp(part["t"]) >= MIN_PIECE_S]


def after_start(path: Path, seed: int) -> list[Recording]:
    """The pieces of a drive that are long enough after the seconds that an alignment by the track takes."""
    return [piece for piece in kitti_pieces(path, seed) if piece.inertial.t_s[-1] >= TRACK_S + MIN_PIECE_S]


def _part(name: str, part: pd.DataFrame, seed: int) -> Recording:
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
    return Recording(name, Imu(t_s, accel, gyro), reference, velocity=measured, static_start_s=rest_s)


def with_noise(t_s: FloatArray, mps: FloatArray, seed: int) -> Velocity:
    """Return ten velocities a second of (n, 3) at 100 Hz, with white noise: what shows a known start."""
    at = np.arange(0, len(t_s), VELOCITY_EVERY)
    noise = VELOCITY_SIGMA_MPS * np.random.default_rng(seed).normal(size=(len(at), 3))
    return Velocity(t_s[at], mps[at] + noise, np.tile(VELOCITY_SIGMA_MPS**2 * np.eye(3), (len(at), 1, 1)))


# The rows of the study: the error of every filter at every setting on every trial.

COLUMNS = ("domain", "trial", "method", "setting", "inclination_rmse_deg")
"""Of the rows. The setting of a filter with its defaults is -1."""


def error_deg(plugin: TiltAndYaw, recordings: Sequence[Recording], burn_in_s: float = 0.0) -> float:
    """Return the RMSE of the inclination over all recordings from ``burn_in_s`` on [deg]."""
    mean_squares, counts = [], []
    for recording in recordings:
        estimate = api.estimate(recording, filter="attitude_only", attitude=replace(plugin, yaw_source="gyro_only"))
        found = api.evaluate(estimate, recording, metrics=["inclination"], burn_in_s=burn_in_s)
        mean_squares.append(found["inclination_rmse_deg"] ** 2)
        counts.append(int((recording.reference.t_s >= burn_in_s).sum()))
    return float(np.sqrt(np.average(mean_squares, weights=counts)))


def saturated_rows(trials: Sequence[Trial]) -> pd.DataFrame:
    """Return the fraction of samples with a saturated gyro, for the trials of domains with a limit."""
    rows = []
    for trial in trials:
        if limit := GYRO_LIMITS_RADPS.get(trial.domain):
            gyro = np.concatenate([np.asarray(recording.inertial.gyro_radps) for recording in trial.recordings()])
            rows.append((trial.domain, trial.name, (np.abs(gyro) > limit).any(axis=1).mean().round(4)))
    return pd.DataFrame(rows, columns=["domain", "trial", "fraction"])


def trial_rows(trial: Trial, count: int = SETTINGS) -> pd.DataFrame:
    """Return the rows of a trial: each filter with its defaults, and at the first ``count`` of its settings."""
    rows = [(trial.domain, trial.name, *row) for row in _of_methods(trial, count)]
    return pd.DataFrame(rows, columns=COLUMNS).astype({"inclination_rmse_deg": "float32", "setting": "int16"})


def _of_methods(trial: Trial, count: int) -> Iterator[tuple[str, int, float]]:
    recordings, known = trial.recordings(), trial.start_is_known
    error = partial(error_deg, recordings=recordings, burn_in_s=TRACK_S if known else 0.0)
    rate_hz = 1.0 / recordings[0].inertial.nominal_interval_s
    for name, plugin in DEFAULTS.items():
        fixed = not known or isinstance(plugin, OfflineVqf)  # a smoother finds its start itself
        yield name, -1, error(plugin if fixed else replace(plugin, alignment="track"))
    for name, method in METHODS.items():
        for number, setting in enumerate(method.settings()[:count]):
            yield name, number, error(method.plugin(setting, rate_hz, "track" if known else ""))


def all_rows(trials: Sequence[Trial], folder: Path, workers: int, count: int = SETTINGS) -> pd.DataFrame:
    """Return the rows of all trials. They are stored in ``folder``, and rows that are there are not computed again."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = {folder / f"{trial.domain}-{trial.name.replace(' ', '-')}-{count}.parquet": trial for trial in trials}
    missing = {path: trial for path, trial in paths.items() if not path.is_file()}
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        list(pool.map(partial(_store, count=count), missing, missing.values()))
    return pd.concat([pd.read_parquet(path) for path in paths], ignore_index=True)


def _store(path: Path, trial: Trial, count: int) -> None:
    partial_file = path.with_suffix(".partial")
    trial_rows(trial, count).to_parquet(partial_file, index=False)
    partial_file.replace(path)


def plain_table(head: Iterable[object], rows: Iterable[Iterable[object]]) -> str:
    """Return rows of texts as a Markdown table."""
    lines = [[*map(str, line)] for line in (head, *rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in (lines[0], ["---"] * len(lines[0]), *lines[1:]))
