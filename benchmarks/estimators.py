"""The speed of the estimators: the compiled way of each against its definition in NumPy.

    python benchmarks/estimators.py [--rounds 5] [--runs 64] [--drive FOLDER [--kf-gins SOURCE]]

Workload: a drive of `field` of 150 s, IMU at 100 Hz, fixes and velocities at 10 Hz, the reference at every sample,
adaptation mtf. In each round all ways of an estimator run one after the other; a line has the median of the times that
passed, and the median over the rounds of the ratio to NumPy in the same round. A single run begins with the recording
and its attitude and keeps its trajectory; eskf15 keeps what does not depend on the adaptation for the next. Many runs
keep sums of errors and share all cores; their recordings are prepared, and their time is divided by their number.
Below stand the smallest CPU times, all threads together, and their ratios: what another user of the machine takes from
a thread does not count there, and so what a second core brings does not either. With the data of the real drive eskf15
stands beside KF-GINS and python-ins, too (drive.py).
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
"""Different recordings; many runs go round among them."""


def recorded_runs() -> list[RecordedRun]:
    """Different drives, with what their errors count for."""
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
    """The ways of one estimator."""
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
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5, help="how often all of them are timed (default 5)")
    parser.add_argument("--runs", type=int, default=64, help="how many runs at once (default 64)")
    parser.add_argument("--drive", type=Path, help="the data of the real drive, for drive.py")
    parser.add_argument("--kf-gins", type=Path, help="a copy of KF-GINS's repository, likewise")
    asked, runs = parser.parse_args(), recorded_runs()
    print(f"{'':<34}{'time':>13}{'ratio':>11}{'difference':>12}")
    for name in ("eskf15", "imm", "rts"):
        ways = entrants(name, runs, asked.runs)
        for line in in_rounds(ways, asked.rounds):
            print(line, flush=True)
        base, _ = timed(ways[0].run, 2)
        for way in ways[1:]:
            seconds = timed(way.run, 3)[0] / way.runs
            print(f"{'':<4}{'its CPU time':<30}{seconds * 1e3:>10.2f} ms{base / seconds:>9.1f} x")
    if asked.drive is None:
        print("The real drive is not timed: --drive names no folder with its data.")
    else:
        print_drive(asked.drive, asked.kf_gins, DRIVE_OF_PYTHON_INS_S)


if __name__ == "__main__":
    main()
