"""How fast are the engines? Prints a table of ratios to a plain filterpy loop, with the agreement beside each.

    python benchmarks/engines.py [--repeats 20]

Workload: filter jerk (9 states), 15 000 steps of 0.01 s, 1 500 updates of six rows with a full R that changes.
Times are CPU times of this process, the smallest of the repeats; libraries that are not installed are left out.
"""

import argparse
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from plain_loops import filterpy_loop, full_model, start

from jerkbench import plugins
from jerkbench.arrays import FloatArray
from jerkbench.attitude.compiled_tilt import run_tilt_compiled
from jerkbench.attitude.tilt import TiltParameters, run_tilt, start_state
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.timeline.measurements import Measurements
from jerkbench.timeline.timeline import Timeline

DT_S, STEPS, EVERY = 0.01, 15_000, 10


class Line(NamedTuple):
    """One line of the table.

    Attributes:
        name: what ran.
        seconds: the smallest CPU time.
        base: that of the loop that it is compared with.
        difference: the largest difference of its results from that loop's.
    """

    name: str
    seconds: float
    base: float
    difference: float

    def __str__(self) -> str:
        """Name, time, ratio, agreement."""
        return (
            f"{self.name:<34}{self.seconds * 1e3:>10.2f} ms{self.base / self.seconds:>9.1f} x{self.difference:>12.1e}"
        )


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


def smallest(run: Callable[[], object], repeats: int) -> float:
    """Return the smallest CPU time of ``run`` [s]; it ran once before, so that nothing is compiled in between."""
    run()
    times = []
    for _ in range(repeats):
        begin = time.process_time()
        run()
        times.append(time.process_time() - begin)
    return min(times)


def navigation_lines(timeline: Timeline, repeats: int) -> list[Line]:
    """The engines, without and with an adaptation, and the libraries that are installed."""
    model, none = plugins.create("filter", {"name": "jerk"}), plugins.create("adaptation", {"name": "none"})
    x, _ = filterpy_loop(timeline, model)
    base = smallest(lambda: filterpy_loop(timeline, model), 3)
    lines = [Line("plain filterpy loop", base, base, 0.0)]
    reference = FilterpyEngine()
    difference = _apart(reference.run(timeline, model, none).position_m, x[:, :3])
    lines.append(Line("engine filterpy", smallest(lambda: reference.run(timeline, model, none), 2), base, difference))
    engine = CompiledEngine()
    for name in ("none", "mtf", "sage_husa"):
        rule = plugins.create("adaptation", {"name": name})
        wanted = x[:, :3] if name == "none" else reference.run(timeline, model, rule).position_m
        difference = _apart(engine.run(timeline, model, rule).position_m, wanted)
        seconds = smallest(lambda rule=rule: engine.run(timeline, model, rule), repeats)  # type: ignore[misc]  # mypy knows no default in a lambda
        lines.append(Line(f"engine compiled, {name}", seconds, base, difference))
    return lines + simdkalman_line(timeline, x, base)


def simdkalman_line(timeline: Timeline, x: FloatArray, base: float) -> list[Line]:
    """simdkalman, which takes no input: u goes in from outside, between its prediction and its update."""
    try:
        from simdkalman.primitives import predict, update
    except ImportError:
        return []
    model = plugins.create("filter", {"name": "jerk"})
    F, B, Q = full_model(timeline, model)

    def run() -> FloatArray:
        m, P = start(timeline, model)
        m, out, H = m[:, None], np.empty_like(x), np.eye(6, len(m))
        for k, (sample, which) in enumerate(zip(timeline.sample, timeline.update, strict=True)):
            if k:
                m, P = predict(m, P, F, Q)
                m = m + B @ timeline.accel_enu_mps2[sample][:, None]
            if which >= 0:
                m, P = update(m, P, H, timeline.measurements.R[which], timeline.measurements.z[which][:, None])
            out[k] = m[:, 0]
        return out

    return [Line("simdkalman, step by step", smallest(run, 2), base, _apart(run()[:, :3], x[:, :3]))]


def tilt_lines(repeats: int) -> list[Line]:
    """The tilt filter, NumPy and compiled."""
    rng = np.random.default_rng(1)
    gyro = rng.normal(0.0, 0.1, (STEPS, 3))
    accel = np.array([0.0, 0.0, 9.81]) + rng.normal(0.0, 0.3, (STEPS, 3))
    given = (start_state(np.array([0.0, 0.0, 1.0]), 1e-3), gyro, accel, np.full(STEPS, DT_S), TiltParameters())
    base = smallest(lambda: run_tilt(*given), 2)
    difference = _apart(run_tilt_compiled(*given)[0], run_tilt(*given)[0])
    compiled = smallest(lambda: run_tilt_compiled(*given), repeats)
    return [Line("tilt filter, NumPy", base, base, 0.0), Line("tilt filter, compiled", compiled, base, difference)]


def _apart(got: FloatArray, wanted: FloatArray) -> float:
    return float(np.abs(got - wanted).max())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=20, help="how often each compiled run is timed")
    repeats = parser.parse_args().repeats
    print(f"{'':<34}{'time':>13}{'ratio':>11}{'difference':>12}")
    for line in navigation_lines(workload(), repeats) + tilt_lines(repeats):
        print(line)


if __name__ == "__main__":
    main()
