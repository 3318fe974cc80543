"""How fast are the engines? Prints a table of ratios to a plain filterpy loop, with the agreement beside each.

    python benchmarks/engines.py [--repeats 20] [--runs 1000]

Workload: filter jerk (9 states), 15 000 steps of 0.01 s, 1 500 updates of six rows with a full R that changes.
Times are CPU times of this process, the smallest of the repeats, but for our many runs, whose errors are summed up as
they go: there it is the time that passes with all cores, divided by the number of runs. Other libraries: peers.py; of
many runs at once the time of one is given, on one core. `pip install '.[bench]'` installs them; one that is not
installed is named.
"""

import argparse
import os
import time

import numpy as np
from lines import Absent, Line, apart, smallest
from peers import peer_lines
from plain_loops import filterpy_loop

from jerkbench import plugins
from jerkbench.attitude.compiled_tilt import run_tilt_compiled
from jerkbench.attitude.tilt import TiltParameters, run_tilt, start_state
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.streamed import Run, Scoring
from jerkbench.timeline.measurements import Measurements
from jerkbench.timeline.timeline import Timeline

DT_S, STEPS, EVERY = 0.01, 15_000, 10


def workload(seed: int = 0) -> Timeline:
    """The timeline that all of them run, with a stamp of the reference at every step."""
    rng = np.random.default_rng(seed)
    m, n = STEPS // EVERY, STEPS + 1
    half = rng.normal(0.0, 0.01, (m, 6, 12))
    R = half @ half.transpose(0, 2, 1)
    update = np.full(n, -1)
    update[EVERY::EVERY] = np.arange(m)
    z = rng.normal(0.0, 0.03, (m, 6))
    return Timeline(
        dt0_s=DT_S,
        dt_s=np.concatenate([[0.0], np.full(STEPS, DT_S)]),
        sample=np.maximum(np.arange(n) - 1, 0),
        update=update,
        reference=np.arange(n),
        accel_enu_mps2=rng.normal(0.0, 0.2, (STEPS, 3)),
        measurements=Measurements((np.arange(m) + 1) * 100_000_000, z, R, R),
        x0=np.zeros(6),
        P0=np.eye(6),
        euler_rad=np.zeros((n, 3)),
        t_s=np.arange(n) * DT_S,
    )


def navigation_lines(timeline: Timeline, repeats: int, runs: int) -> list[Line | Absent]:
    """The engines, without and with an adaptation, and the libraries that are installed."""
    model, none = plugins.create("filter", {"name": "jerk"}), plugins.create("adaptation", {"name": "none"})
    x, _ = filterpy_loop(timeline, model)
    base = smallest(lambda: filterpy_loop(timeline, model), 3)
    lines: list[Line | Absent] = [Line("plain filterpy loop", base, base, 0.0)]
    reference = FilterpyEngine()
    difference = apart(reference.run(timeline, model, none).position_m, x[:, :3])
    lines.append(Line("engine filterpy", smallest(lambda: reference.run(timeline, model, none), 2), base, difference))
    engine = CompiledEngine()
    for name in ("none", "mtf", "sage_husa"):
        rule = plugins.create("adaptation", {"name": name})
        wanted = x[:, :3] if name == "none" else reference.run(timeline, model, rule).position_m
        difference = apart(engine.run(timeline, model, rule).position_m, wanted)
        seconds = smallest(lambda rule=rule: engine.run(timeline, model, rule), repeats)  # type: ignore[misc]  # mypy knows no default in a lambda
        lines.append(Line(f"engine compiled, {name}", seconds, base, difference))
    return lines + many_lines(base, runs) + peer_lines(timeline, x, base, min(repeats, 2))


def many_lines(base: float, runs: int) -> list[Line | Absent]:
    """Many runs side by side, in blocks as a sweep makes them, without trajectories."""
    model, engine, threads = plugins.create("filter", {"name": "jerk"}), CompiledEngine(), os.cpu_count() or 1
    block = [Run(timeline := workload(seed), scoring_of(timeline)) for seed in range(64)]
    blocks = -(-runs // len(block))
    lines: list[Line | Absent] = []
    for name in ("none", "mtf", "sage_husa"):
        rule = plugins.create("adaptation", {"name": name})
        (one, *_) = engine.run_many(block, model, rule, updates=False, threads=threads)
        wanted = FilterpyEngine().run(block[0].timeline, model, rule).position_m
        difference = abs(np.sqrt(one.position_m2.sum()) - np.sqrt((wanted**2).sum())) / np.sqrt(len(wanted))
        begin = time.perf_counter()
        for _ in range(blocks):
            engine.run_many(block, model, rule, updates=False, threads=threads)
        seconds = (time.perf_counter() - begin) / (blocks * len(block))
        lines.append(Line(f"{blocks * len(block)} runs on {threads} cores, {name}", seconds, base, difference))
    return lines


def scoring_of(timeline: Timeline) -> Scoring:
    """Every stamp counts; the truth is zero."""
    k = len(timeline.t_s)
    one = np.ones(k)
    return Scoring(np.zeros((k, 6)), one, one, one, np.zeros(k), np.zeros(0, dtype=np.int64), 0.0)


def tilt_lines(repeats: int) -> list[Line]:
    """The tilt filter, NumPy and compiled."""
    rng = np.random.default_rng(1)
    gyro = rng.normal(0.0, 0.1, (STEPS, 3))
    accel = np.array([0.0, 0.0, 9.81]) + rng.normal(0.0, 0.3, (STEPS, 3))
    given = (start_state(np.array([0.0, 0.0, 1.0]), 1e-3), gyro, accel, np.full(STEPS, DT_S), TiltParameters())
    base = smallest(lambda: run_tilt(*given), 2)
    difference = apart(run_tilt_compiled(*given)[0], run_tilt(*given)[0])
    compiled = smallest(lambda: run_tilt_compiled(*given), repeats)
    return [Line("tilt filter, NumPy", base, base, 0.0), Line("tilt filter, compiled", compiled, base, difference)]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=20, help="how often each compiled run is timed")
    parser.add_argument("--runs", type=int, default=1000, help="how many runs are made side by side")
    asked = parser.parse_args()
    print(f"{'':<34}{'time':>13}{'ratio':>11}{'difference':>12}")
    for line in navigation_lines(workload(), asked.repeats, asked.runs) + tilt_lines(asked.repeats):
        print(line)


if __name__ == "__main__":
    main()
