"""How far off each alignment is at the first sample of a drive, on the longest piece of each of KITTI's drives."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from trials import kitti_pieces, plain_table

from jerkbench.arrays import FloatArray
from jerkbench.attitude.common import tilt_start
from jerkbench.evaluation.counted_rows import angle_between
from jerkbench.geometry import vertical_in_body
from jerkbench.recording import Position, Recording

FIX_SIGMAS_M = (0.02, 1.0)
"""Of the fixes, one a second: the reference's places with white noise."""


def start_rows(folder: Path) -> pd.DataFrame:
    """Drive, alignment, error [deg]."""
    found = [row for seed, path in enumerate(sorted(folder.glob("*drive*.parquet"))) for row in _rows(path, seed)]
    return pd.DataFrame(found, columns=["drive", "alignment", "error_deg"]).astype({"error_deg": "float32"})


def _rows(path: Path, seed: int) -> Iterator[tuple[str, str, float]]:
    recording = max(kitti_pieces(path, seed), key=lambda piece: len(piece.reference.t_s))
    truth = vertical_in_body(np.asarray(recording.reference.euler_rad))
    for alignment in ("rest", "gravity"):
        yield path.stem, alignment, _off(recording, alignment, truth)
    yield path.stem, "track (velocity, .1 m/s)", _off(recording, "track", truth)
    for sigma_m in FIX_SIGMAS_M:
        yield path.stem, f"track (fixes, {sigma_m:g} m)", _off(with_fixes(recording, sigma_m, seed), "track", truth)


def with_fixes(recording: Recording, sigma_m: float, seed: int) -> Recording:
    """The recording with a fix a second in the place of its velocities."""
    reference = recording.reference
    at = np.arange(0, len(reference.t_s), 100)
    place: FloatArray = np.asarray(reference.enu_m)[at]
    noisy = place + sigma_m * np.random.default_rng(seed).normal(size=place.shape)
    covariance = np.tile(sigma_m**2 * np.eye(3), (len(at), 1, 1))
    return replace(recording, velocity=None, position=Position(reference.t_s[at], noisy, covariance))


def _off(recording: Recording, alignment: str, truth: FloatArray) -> float:
    x = tilt_start(recording, alignment=alignment).x
    return float(np.degrees(angle_between(x[None], truth[:1])[0]))


def start_table(rows: pd.DataFrame) -> str:
    """The error of each alignment at the first sample."""
    found = rows.groupby("alignment", sort=False)["error_deg"]
    cells = [[str(name), f"{own.median():.2f}", f"{own.max():.2f}"] for name, own in found]
    return plain_table(["alignment", "median [deg]", "worst [deg]"], cells)
