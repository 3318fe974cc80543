"""A sweep that is killed fifty times at random moments and resumed, against an undisturbed one.

    python benchmarks/kills.py [KILLS]

A third of the kills come while it starts, at any moment; the others after it has stored something. A sweep that comes
to its end is compared, to the bit, and the next begins in an empty folder.
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
    return subprocess.Popen([sys.executable, "-m", "jerkbench", *WORDS], cwd=folder, **quiet)  # noqa: S603 - our own words


def stored(folder: Path) -> int:
    """How many cells there are."""
    return len(list((folder / "results" / "adhoc" / "cells").glob("*.parquet")))


def rows(folder: Path) -> pd.DataFrame:
    """The rows of the sweep, in an order of their own."""
    table = pd.read_csv(folder / "results" / "adhoc" / "rows.csv")
    return table.sort_values(list(table.columns[:7]), ignore_index=True)


def killed(folder: Path, rng: np.random.Generator) -> bool:
    """Start the sweep and kill it at a random moment; False where it came to its end before."""
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
    """Kill so often, and say what came of it."""
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
    print(f"{hits} kills, {amid} of them between the first cell and the last, over {sweeps} sweeps")
    print(f"each of the {len(expected)} rows is the same, to the bit")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 50)
