"""How far off each alignment is at the first sample of a drive, on the longest piece of each of KITTI's drives.

    python experiments/attitude/starts.py FOLDER [ROWS]

FOLDER holds kitti. The velocities and fixes of `track` are the reference's with white noise: semi-real.
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from page import STARTS

from jerkbench.arrays import FloatArray
from jerkbench.attitude.alignment import tilt_start
from jerkbench.audit.attitude.trials import kitti
from jerkbench.evaluation.navigation_errors import angle_between
from jerkbench.recording import Position, Recording, Velocity

SOURCES = {"velocity, .1 m/s": (0.1, 10), "fixes, .02 m": (0.02, 100), "fixes, 1 m": (1.0, 100)}
"""One sigma of the noise, and samples from one to the next."""


def with_noise(recording: Recording, source: str, seed: int) -> Recording:
    """The recording with a source for the track, from its reference."""
    sigma, every = SOURCES[source]
    reference = recording.reference
    at = np.arange(0, len(reference.t_s), every)
    noise = sigma * np.random.default_rng(seed).normal(size=(len(at), 3))
    covariance = np.tile(sigma**2 * np.eye(3), (len(at), 1, 1))
    if source.startswith("velocity"):
        true: FloatArray = np.asarray(reference.velocity_mps)
        return replace(recording, velocity=Velocity(reference.t_s[at], true[at] + noise, covariance))
    place: FloatArray = np.asarray(reference.enu_m)
    return replace(recording, position=Position(reference.t_s[at], place[at] + noise, covariance))


def rows(folder: Path) -> Iterator[tuple[str, str, float]]:
    """Drive, alignment, error [deg]."""
    for seed, trial in enumerate(kitti(folder)):
        recording, truth, _ = max(trial.pieces(), key=lambda piece: len(piece[1]))
        for alignment in ("rest", "gravity"):
            yield trial.name, alignment, _off(recording, alignment, truth)
        for source in SOURCES:
            yield trial.name, f"track ({source})", _off(with_noise(recording, source, seed), "track", truth)


def _off(recording: Recording, alignment: str, truth: FloatArray) -> float:
    x = tilt_start(recording, alignment=alignment).x
    return float(np.degrees(angle_between(x[None], truth[:1])[0]))


def main() -> None:
    """Keep the rows, and print them."""
    kept = Path(sys.argv[2]) if len(sys.argv) > 2 else STARTS
    table = pd.DataFrame(rows(Path(sys.argv[1]) / "kitti"), columns=["drive", "alignment", "error_deg"])
    table.astype({"error_deg": "float32"}).to_parquet(kept, index=False)
    print(table.groupby("alignment", sort=False)["error_deg"].describe().to_string())


if __name__ == "__main__":
    main()
