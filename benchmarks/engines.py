"""Speed of the engines: ratios to a plain filterpy loop, and the agreement of the positions.

    python benchmarks/engines.py [--rounds 20] [--ours]

Workload: the filter `jerk` (9 states), 15 000 steps of 0.01 s, and 1 500 updates of six rows with a full R that is
different in each update. Each round times all entrants one after the other. A line contains the median elapsed time and
the median over the rounds of the ratio to the plain loop in the same round. A single run of jerkbench stores its
trajectory. A batch of runs stores only sums of errors and of the NEES, and uses all cores. The time of a batch is the
mean of successive batches without the first, divided by the number of runs. Batches as in the tuning and in audits,
which have a diagonal R and compute only errors, have separate lines: 64 recordings (read from memory), and one
recording 64 times (read from the processor cache). The other libraries (peers.py) are slower, so their time is the
smaller of two CPU times on one core, compared with the plain loop. `pip install '.[bench]'` installs the libraries. If
a library is not installed, the script prints its name.
"""

import argparse
import os
from dataclasses import replace
from functools import partial

import numpy as np
from lines import Absent, Entrant, Line, apart, in_rounds, timed
from peers import peer_lines
from plain_loops import filterpy_loop

from jerkbench import plugins
from jerkbench.arrays import FloatArray
from jerkbench.attitude.common import tilt_start
from jerkbench.attitude.tilt import Tilt, run_tilt
from jerkbench.contracts import Engine, Filter
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.estimate import ErrorWeights
from jerkbench.recording import Imu, Recording, Reference
from jerkbench.timeline import Measurements, Run, Timeline

DT_S, STEPS, EVERY = 0.01, 15_000, 10
COMPARED = 600
"""Number of steps for the comparison of iterative adaptations with plain Python, which needs 10 ms for each update."""

BATCHES = 10
"""Number of batches in a round."""

ITERATED = (
    *("huber", "maximum_correntropy", "ssmkf", "student_t", "vbakf_pr"),
    *("cerkf_r", "maximum_correntropy_r", "ssmkf_r"),
)
"""Adaptations that compute the weights of the prediction or of the measurement iteratively."""


def workload(seed: int = 0, most: int = 10**9) -> Timeline:
    """Return the timeline of the workload with at most ``most`` steps, and a reference at every step."""
    rng, steps = np.random.default_rng(seed), min(STEPS, most)
    m, n = steps // EVERY, steps + 1
    half = rng.normal(0.0, 0.01, (m, 6, 12))
    R = half @ half.transpose(0, 2, 1)
    update = np.full(n, -1)
    update[EVERY::EVERY] = np.arange(m)
    z = rng.normal(0.0, 0.03, (m, 6))
    return Timeline(
        dt0_s=DT_S,
        dt_s=np.concatenate([[0.0], np.full(steps, DT_S)]),
        sample=np.maximum(np.arange(n) - 1, 0),
        update=update,
        reference=np.arange(n),
        accel_enu_mps2=rng.normal(0.0, 0.2, (steps, 3)),
        measurements=Measurements((np.arange(m) + 1) * 100_000_000, z, R, R),
        x0=np.zeros(6),
        P0=np.eye(6),
        euler_rad=np.zeros((n, 3)),
        t_s=np.arange(n) * DT_S,
    )


def navigation_lines(timeline: Timeline, rounds: int, *, others: bool) -> list[Line | Absent]:
    """Measure the engines with and without an adaptation and, if ``others`` is true, the installed libraries."""
    model = plugins.create("filter", {"name": "jerk"})
    x, _ = filterpy_loop(timeline, model)
    loop = Entrant("plain filterpy loop", lambda: filterpy_loop(timeline, model), 1, 1, 0.0)
    ours = in_rounds([loop, *single_entrants(timeline, model, x), *many_entrants(model)], rounds)
    base, _ = timed(loop.run, 3)
    ours += in_rounds([loop, *error_entrants(model)], rounds)[1:]
    return [*ours, *(peer_lines(timeline, x, base, 2) if others else [])]


def single_entrants(timeline: Timeline, model: Filter, x: FloatArray) -> list[Entrant]:
    """Return the entrants with a single run that stores its trajectory."""
    engine, reference, entrants = CompiledEngine(), FilterpyEngine(), []
    for name in ("none", "mtf", "sage_husa", *ITERATED):
        rule = plugins.create("adaptation", {"name": name})
        compared = workload(most=COMPARED) if name in ITERATED else timeline
        wanted = reference.run(compared, model, rule).position_m
        if name == "none":
            run = partial(reference.run, timeline, model, rule)
            entrants.append(Entrant("engine filterpy", run, 1, 1, apart(wanted, x[:, :3])))
        run, got = partial(engine.run, timeline, model, rule), engine.run(compared, model, rule)
        entrants.append(Entrant(f"engine compiled, {name}", run, 9, 1, apart(got.position_m, wanted)))
    return entrants


def many_entrants(model: Filter) -> list[Entrant]:
    """Return the entrants with a batch of runs without trajectories, as large as in a sweep."""
    engine, threads, entrants = CompiledEngine(), os.cpu_count() or 1, []
    block = [Run(timeline := workload(seed), scoring_of(timeline)) for seed in range(64)]
    for name in ("none", "mtf", "sage_husa", *ITERATED):
        rule = plugins.create("adaptation", {"name": name})
        run = partial(engine.run_settings, block, [model] * 64, [rule] * 64, updates=False, threads=threads)
        one: Engine = engine if name in ITERATED else FilterpyEngine()  # compared in single_entrants
        (first, *_), wanted = run(), one.run(block[0].timeline, model, rule).position_m
        difference = abs(np.sqrt(first.position_m2.sum()) - np.sqrt((wanted**2).sum())) / np.sqrt(len(wanted))
        entrants.append(Entrant(f"{len(block)} runs, {threads} cores, {name}", run, BATCHES, len(block), difference))
    return entrants


def error_entrants(model: Filter) -> list[Entrant]:
    """Return the entrants with a batch of runs that computes only errors, with a diagonal R."""
    engine, threads, entrants = CompiledEngine(), os.cpu_count() or 1, []
    for name in ("none", "mtf", "huber_r", "sage_husa", "huber", "maximum_correntropy"):
        rule = plugins.create("adaptation", {"name": name})
        for recordings in (64, 1):
            several = [uncorrelated(workload(seed)) for seed in range(recordings)] * (64 // recordings)
            scores = {id(of): scoring_of(of, consistency=False) for of in several}
            block = [Run(timeline, scores[id(timeline)]) for timeline in several]
            run = partial(engine.run_settings, block, [model] * 64, [rule] * 64, updates=False, threads=threads)
            (first, *_), wanted = run(), FilterpyEngine().run(several[0], model, rule).position_m
            difference = abs(np.sqrt(first.position_m2.sum()) - np.sqrt((wanted**2).sum())) / np.sqrt(len(wanted))
            where = "memory" if recordings > 1 else "cache"
            entrants.append(Entrant(f"errors, from {where}, {name}", run, BATCHES, len(block), difference))
    return entrants


def uncorrelated(timeline: Timeline) -> Timeline:
    """Return the timeline with a diagonal R."""
    measured = timeline.measurements
    R = measured.R * np.eye(6)
    return replace(timeline, measurements=replace(measured, R=R, R_true=R))


def scoring_of(timeline: Timeline, *, consistency: bool = True) -> ErrorWeights:
    """Return weights that evaluate the errors at all times; the true values are zero."""
    k = len(timeline.t_s)
    ones, nothing = np.ones(k), np.zeros(0, dtype=np.int64)
    return ErrorWeights(np.zeros((k, 6)), ones, ones, ones, np.zeros(k), nothing, 0.0, consistency)


def tilt_lines(rounds: int) -> list[Line]:
    """Measure the loop of the tilt filter, uncompiled and compiled."""
    rng = np.random.default_rng(1)
    gyro = rng.normal(0.0, 0.1, (STEPS, 3))
    accel = np.array([0.0, 0.0, 9.81]) + rng.normal(0.0, 0.3, (STEPS, 3))
    imu = Imu(DT_S * np.arange(1, STEPS + 1), accel, gyro)
    drive = Recording("noise", imu, Reference([DT_S], "made up", independent=True))

    def uncompiled() -> FloatArray:
        x, triggered = np.empty((STEPS, 3)), np.empty(STEPS, dtype=np.bool_)
        run_tilt(Tilt().state(tilt_start(drive)), gyro, accel, imu.intervals_s, x, triggered)
        return x

    difference = apart(Tilt().verticals(drive)[0], uncompiled())
    slow = Entrant("tilt filter, uncompiled", uncompiled, 1, 1, 0.0)
    fast = Entrant("tilt filter, compiled", partial(Tilt().verticals, drive), 9, 1, difference)
    return in_rounds([slow, fast], rounds)


def main() -> None:
    """Measure all entrants and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=20, help="number of rounds (default 20)")
    parser.add_argument("--ours", action="store_true", help="omit the other libraries")
    asked = parser.parse_args()
    print(f"{'':<34}{'time':>13}{'ratio':>11}{'difference':>12}")
    for line in [*navigation_lines(workload(), asked.rounds, others=not asked.ours), *tilt_lines(asked.rounds)]:
        print(line)


if __name__ == "__main__":
    main()
