"""Speed of the estimators: the compiled code of each estimator compared with its NumPy code.

    python benchmarks/estimators.py [--rounds 5] [--runs 64] [--drive FOLDER [--kf-gins SOURCE]]

Workload: a drive of the data set `field` of 150 s with the adaptation `mtf`. The IMU has 100 Hz, the fixes and the
velocities 10 Hz, and each IMU sample has a reference. Each round times all implementations of an estimator one after
the other. A line contains the median elapsed time, and the median over the rounds of the ratio to NumPy in the same
round. A single run starts with the recording and its attitude, and stores its trajectory. `eskf15` caches the data that
do not depend on the adaptation. A batch of runs stores only sums of errors and uses all cores. The recordings of a
batch are prepared before the measurement. The time of a batch is divided by its number of runs. The lines below contain
the minimum CPU time of all threads together, and the ratio of the CPU times. The CPU time does not depend on other
processes, but does not show the gain from a second core. With the data of the real drive, the script also compares
`eskf15` with KF-GINS and python-ins (drive.py).
"""

import argparse
import os
from functools import partial
from pathlib import Path

import numpy as np
from drive import print_drive
from lines import Entrant, apart, in_rounds, timed

from jerkbench import plugins
from jerkbench.adaptation.mtf import Mtf
from jerkbench.attitude.tilt import Tilt
from jerkbench.contracts import Batched
from jerkbench.datasets.field import FieldWhite
from jerkbench.evaluation.evaluated_run import prepare_reference
from jerkbench.timeline import RecordedRun, build_timeline

BURN_IN_S = 5.0
DRIVE_OF_PYTHON_INS_S = 70.0
SEEDS = 8
"""Number of different recordings, which the runs of a batch use in turn."""


def recorded_runs() -> list[RecordedRun]:
    """Return runs on different drives, with the weights of their errors."""
    runs = []
    for seed in range(SEEDS):
        recording = FieldWhite().load(seed)
        attitude = Tilt().estimate(recording)
        timeline = build_timeline(recording, attitude)
        scene = prepare_reference(recording, timeline, BURN_IN_S)
        if scene is not None:
            runs.append(RecordedRun(recording, attitude, timeline, scene.scoring))
    return runs


def entrants(name: str, runs: list[RecordedRun], number: int) -> list[Entrant]:
    """Return the implementations of one estimator."""
    model, (run, *_), threads = plugins.create("filter", {"name": name}), runs, os.cpu_count() or 1
    given = run.recording, run.attitude, Mtf()
    wanted = model.estimate(*given)
    ways = [Entrant(f"{name}, NumPy", partial(model.estimate, *given), 1, 1, 0.0)]
    if not isinstance(model, Batched):
        return ways
    got = model.estimate_compiled(*given)
    difference = float("nan") if got is None else apart(got.position_m, wanted.position_m)
    ways.append(Entrant(f"{name}, compiled", partial(model.estimate_compiled, *given), 5, 1, difference))
    many = [runs[k % len(runs)] for k in range(number)]
    stream = partial(
        model.run_settings, many, [model] * number, [Mtf()] * number, updates=False, attitude=False, threads=threads
    )
    sums = stream()[0]
    rms = np.sqrt((((wanted.position_m - run.scoring.truth[:, :3]) * run.scoring.counted[:, None]) ** 2).sum())
    apart_m = float("nan") if sums is None else abs(np.sqrt(sums.position_m2.sum()) - rms) / np.sqrt(len(wanted.index))
    ways.append(Entrant(f"{name}, {number} runs, {threads} cores", stream, 1, number, float(apart_m)))
    return ways


def main() -> None:
    """Measure all estimators and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5, help="number of rounds (default 5)")
    parser.add_argument("--runs", type=int, default=64, help="number of runs in a batch (default 64)")
    parser.add_argument("--drive", type=Path, help="folder with the data of the real drive, for drive.py")
    parser.add_argument("--kf-gins", type=Path, help="copy of the repository of KF-GINS, for drive.py")
    asked, runs = parser.parse_args(), recorded_runs()
    print(f"{'':<34}{'time':>13}{'ratio':>11}{'difference':>12}")
    for name in ("eskf15", "imm", "rts"):
        ways = entrants(name, runs, asked.runs)
        for line in in_rounds(ways, asked.rounds):
            print(line, flush=True)
        base, _ = timed(ways[0].run, 2)
        for way in ways[1:]:
            seconds = timed(way.run, 3)[0] / way.runs
            print(f"{'':<4}{'CPU time':<30}{seconds * 1e3:>10.2f} ms{base / seconds:>9.1f} x")
    if asked.drive is None:
        print("The real drive is not timed: --drive does not name a folder with its data.")
    else:
        print_drive(asked.drive, asked.kf_gins, DRIVE_OF_PYTHON_INS_S)


if __name__ == "__main__":
    main()
