"""Every setting of every method on every trial: the rows that the page is made of.

    python experiments/attitude/run.py FOLDER [ROWS [SETTINGS]]

FOLDER holds broad, repoimu and kitti. Two processes. ROWS is the file to write; SETTINGS may be fewer than all.
"""

import sys
from concurrent.futures import ProcessPoolExecutor
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
from methods import AS_THEY_COME, METHODS, SETTINGS
from trials import Trial, all_trials

from jerkbench.attitude.common import TiltAndYaw
from jerkbench.evaluation.navigation_errors import angle_between

KEPT = Path(__file__).parent / "errors.parquet"
WORKERS = 2


def error_deg(plugin: TiltAndYaw, trial: Trial) -> float:
    """Return the RMSE of the inclination over all pieces that count [deg]."""
    squares, count = 0.0, 0
    for recording, truth, counted in trial.pieces:
        x, _ = plugin.verticals(recording)
        squares += float((angle_between(x[counted], truth[counted]) ** 2).sum())
        count += int(counted.sum())
    return float(np.degrees(np.sqrt(squares / count)))


trials_in = cache(all_trials)
"""Once in each process."""


def rows_of(folder: Path, method: str, number: int) -> list[tuple[str, str, str, int, float]]:
    """Domain, trial, method, number of the setting (-1: as it comes), error of each trial."""
    if number < 0:
        plugins = dict.fromkeys(range(len(trials_in(folder))), AS_THEY_COME[method])
    else:
        setting = METHODS[method].settings()[number]
        plugins = {k: METHODS[method].make(setting, trial.rate_hz) for k, trial in enumerate(trials_in(folder))}
    return [
        (trial.domain, trial.name, method, number, error_deg(plugins[k], trial))
        for k, trial in enumerate(trials_in(folder))
    ]


def main() -> None:
    """Run them, and keep the rows."""
    folder, kept = Path(sys.argv[1]), Path(sys.argv[2]) if len(sys.argv) > 2 else KEPT
    count = int(sys.argv[3]) if len(sys.argv) > 3 else SETTINGS
    tasks = [(name, -1) for name in AS_THEY_COME]
    tasks += [(name, k) for k in range(count) for name in METHODS]
    names, numbers = zip(*tasks, strict=True)
    with ProcessPoolExecutor(WORKERS, get_context("spawn")) as pool:
        found = []
        for done, rows in enumerate(pool.map(rows_of, [folder] * len(tasks), names, numbers), start=1):
            found += rows
            print(f"\r{done} of {len(tasks)}", end="", flush=True)
    table = pd.DataFrame(found, columns=["domain", "trial", "method", "setting", "inclination_rmse_deg"])
    table.astype({"inclination_rmse_deg": "float32", "setting": "int16"}).to_parquet(kept, index=False)
    print("\n", table.groupby(["domain", "method"])["inclination_rmse_deg"].median())


if __name__ == "__main__":
    main()
