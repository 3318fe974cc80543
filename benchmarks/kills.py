"""Comparison of sweeps that are killed at random moments and resumed with an undisturbed sweep.

    python benchmarks/kills.py [KILLS]

A third of the kills occur at a random moment within the first 4 s, the others after the sweep has stored a combination.
The rows of each finished sweep are compared with the rows of the undisturbed sweep, to the bit. The next sweep starts
in an empty folder.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd

CELLS = ("filter=baseline,jerk,bias", "adaptation=none,mtf", "disturbance=none,imu_bias")
WORDS = ("run", "-m", *CELLS, "dataset.duration_s=60", "seeds=5", "workers=2", "figures=false")


def start(folder: Path) -> subprocess.Popen[bytes]:
    """Start the sweep in ``folder``."""
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return subprocess.Popen([sys.executable, "-m", "jerkbench", *WORDS], cwd=folder, **quiet)  # noqa: S603 - fixed


def stored(folder: Path) -> int:
    """Return the number of stored files."""
    return len(list((folder / "results" / "adhoc" / "cells").glob("*.parquet")))


def rows(folder: Path) -> pd.DataFrame:
    """Return the sorted rows of the sweep."""
    table = pd.read_csv(folder / "results" / "adhoc" / "rows.csv")
    return table.sort_values(list(table.columns[:7]), ignore_index=True)


def killed(folder: Path, rng: np.random.Generator) -> bool:
    """Start the sweep and kill it at a random moment. Return False if the sweep finished before."""
    before, process = stored(folder), start(folder)
    if rng.uniform() > 1 / 3:
        while process.poll() is None and stored(folder) == before:
            time.sleep(0.005)
        time.sleep(rng.uniform(0.0, 0.5))
    else:
        time.sleep(rng.uniform(0.0, 4.0))
    if process.poll() is not None:
        return False
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    return True


def main(kills: int) -> None:
    """Kill sweeps ``kills`` times, compare the rows of the finished sweeps, and print the result."""
    rng = np.random.default_rng(1)
    with tempfile.TemporaryDirectory() as place:
        whole = Path(place) / "whole"
        whole.mkdir()
        start(whole).wait()
        expected = rows(whole)
        hits, sweeps, amid = 0, 0, 0
        while hits < kills:
            sweeps += 1
            folder = Path(place) / f"sweep{sweeps}"
            folder.mkdir()
            while hits < kills and killed(folder, rng):
                hits += 1
                amid += 0 < stored(folder) < stored(whole)
            start(folder).wait()
            pd.testing.assert_frame_equal(rows(folder), expected, check_exact=True)
            print(f"sweep {sweeps}: {hits} kills so far", flush=True)
    print(f"{hits} kills, {amid} of them between the first and the last stored combination, in {sweeps} sweeps")
    print(f"all {len(expected)} rows of each sweep are identical to the rows of the undisturbed sweep")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50)
