"""Every setting of every method on every trial: the rows of the audit, kept trial by trial."""

import hashlib
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from importlib.metadata import version
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd

from jerkbench.attitude.common import TiltAndYaw
from jerkbench.attitude.vqf import OfflineVqf
from jerkbench.audit.attitude.methods import AS_THEY_COME, TILT_METHODS, TILT_SETTINGS
from jerkbench.audit.attitude.trials import TiltPiece, TiltTrial
from jerkbench.evaluation.counted_rows import angle_between
from jerkbench.files import write_atomically
from jerkbench.jobs.key import code_digest, versions
from jerkbench.jobs.progress import Progress

COMPUTED_BY = tuple(f"audit/attitude/{name}" for name in ("methods", "rows", "trials"))
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
    with Progress(len(paths), len(paths) - len(left), doing="Attitude filters", unit="trials") as bar:
        for _ in _done(left, workers, count):
            bar.advance()
    return pd.concat([pd.read_parquet(path) for path in paths], ignore_index=True)


def _done(left: dict[Path, TiltTrial], workers: int, count: int) -> Iterator[None]:
    """Keep the rows of each trial as they come."""
    counts = [count] * len(left)
    if workers < 2:
        yield from map(_keep, left.values(), left, counts)
        return
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        try:
            yield from pool.map(_keep, left.values(), left, counts)
        finally:
            pool.shutdown(cancel_futures=True)  # whoever is stopped begins no other trial


def _keep(trial: TiltTrial, path: Path, count: int) -> None:
    rows = trial_rows(trial, count)
    write_atomically(path, lambda partial: rows.to_parquet(partial, index=False))


def _part_path(trial: TiltTrial, folder: Path, count: int) -> Path:
    """The file of a trial's rows: its name tells code, libraries and data apart."""
    parts = [code_digest(*COMPUTED_BY), *versions().values(), version("vqf"), trial.fingerprint, str(count)]
    digest = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:16]
    return folder / f"{trial.domain}-{trial.name.replace(' ', '-')}-{digest}.parquet"
