"""The speed of the engines: ratios to a plain filterpy loop, with the agreement beside each.

    python benchmarks/engines.py [--rounds 20] [--ours]

Workload: filter jerk (9 states), 15 000 steps of 0.01 s, 1 500 updates of six rows with a full R that changes.
In each round all of them run one after the other; a line has the median time that passed, and the median over the
rounds of the ratio to the loop in the same round. Many runs of ours keep sums of errors and of NEES, no trajectories,
and use all cores: their time is divided by their number, and is the mean of batches in a row, the first left out. As
tuning and audits have them, with a diagonal R and errors alone, they stand apart: of 64 recordings, which come from
memory, and 64 times of one, which stays in the cache. The other libraries (peers.py) are too slow for that: the
smallest of two CPU times on one core against that of the loop. `pip install '.[bench]'` installs them; one that is not
is named.
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
"""Steps over which an adaptation that iterates is compared with plain Python, 10 ms an update."""

BATCHES = 10
"""So many batches of many runs are made in a round."""

ITERATED = (
    *("huber", "maximum_correntropy", "ssmkf", "student_t", "vbakf_pr"),
    *("cerkf_r", "maximum_correntropy_r", "ssmkf_r"),
)
"""Adaptations that weigh prior and measurement, or rows of the latter, again and again."""


def workload(seed: int = 0, most: int = 10**9) -> Timeline:
    """The timeline that all of them run, or so many steps of one, with a stamp of the reference at every step."""
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
    """The engines, without and with an adaptation, and (if wanted) the ``others``: libraries that are installed."""
    model = plugins.create("filter", {"name": "jerk"})
    x, _ = filterpy_loop(timeline, model)
    loop = Entrant("plain filterpy loop", lambda: filterpy_loop(timeline, model), 1, 1, 0.0)
    ours = in_rounds([loop, *single_entrants(timeline, model, x), *many_entrants(model)], rounds)
    base, _ = timed(loop.run, 3)
    ours += in_rounds([loop, *error_entrants(model)], rounds)[1:]
    return [*ours, *(peer_lines(timeline, x, base, 2) if others else [])]


def single_entrants(timeline: Timeline, model: Filter, x: FloatArray) -> list[Entrant]:
    """One run that keeps its trajectory."""
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
    """Many runs side by side, as many as a sweep makes at once, without trajectories."""
    engine, threads, entrants = CompiledEngine(), os.cpu_count() or 1, []
    block = [Run(timeline := workload(seed), scoring_of(timeline)) for seed in range(64)]
    for name in ("none", "mtf", "sage_husa", *ITERATED):
        rule = plugins.create("adaptation", {"name": name})
        run = partial(engine.run_settings, block, [model] * 64, [rule] * 64, updates=False, threads=threads)
        one: Engine = engine if name in ITERATED else FilterpyEngine()  # of the former stands above what it is worth
        (first, *_), wanted = run(), one.run(block[0].timeline, model, rule).position_m
        difference = abs(np.sqrt(first.position_m2.sum()) - np.sqrt((wanted**2).sum())) / np.sqrt(len(wanted))
        entrants.append(Entrant(f"{len(block)} runs, {threads} cores, {name}", run, BATCHES, len(block), difference))
    return entrants


def error_entrants(model: Filter) -> list[Entrant]:
    """Many runs of which errors alone are asked, with an R that has nothing between two rows."""
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
    """The same timeline with the diagonal of R alone."""
    measured = timeline.measurements
    R = measured.R * np.eye(6)
    return replace(timeline, measurements=replace(measured, R=R, R_true=R))


def scoring_of(timeline: Timeline, *, consistency: bool = True) -> ErrorWeights:
    """Every stamp counts; the truth is zero."""
    k = len(timeline.t_s)
    ones, nothing = np.ones(k), np.zeros(0, dtype=np.int64)
    return ErrorWeights(np.zeros((k, 6)), ones, ones, ones, np.zeros(k), nothing, 0.0, consistency)


def tilt_lines(rounds: int) -> list[Line]:
    """The loop of the tilt filter, as it is and compiled."""
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
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=20, help="how often all of them are timed (default 20)")
    parser.add_argument("--ours", action="store_true", help="leave the other libraries out")
    asked = parser.parse_args()
    print(f"{'':<34}{'time':>13}{'ratio':>11}{'difference':>12}")
    for line in [*navigation_lines(workload(), asked.rounds, others=not asked.ours), *tilt_lines(asked.rounds)]:
        print(line)


if __name__ == "__main__":
    main()
