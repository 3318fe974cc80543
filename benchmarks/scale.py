"""CPU time and memory of sweeps with thousands of combinations, without the runs: planning, storing, reading, tables.

    python benchmarks/scale.py [--cells 10000] [--seeds 4]

The plan is a real plan. The rows are synthetic and have the metrics of a real run. Each line contains a stage, the CPU
time of this process (user and system), the CPU time per combination, and the peak memory of the process up to this
stage.
"""

import argparse
import contextlib
import io
import resource
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.key import write_manifest
from jerkbench.jobs.plan import Plan, planned
from jerkbench.jobs.rows import Task, job_rows
from jerkbench.jobs.run import blocks_of, origin
from jerkbench.jobs.store import RowBlock, Store, table_of
from jerkbench.jobs.study import load_study, write_study
from jerkbench.report.terminal import MAX_ROWS, print_table

FILTERS, ADAPTATIONS = ("jerk", "baseline"), ("none", "mtf", "huber", "sage_husa")
BUNDLE = 64
"""Number of combinations in a stored part."""


def tell(stage: str, cells: int, work: Callable[[], Any]) -> Any:  # noqa: ANN401 - any result
    """Print the CPU time and the peak memory of ``work``, and return its result."""
    begin = time.process_time()
    result = work()
    seconds = time.process_time() - begin
    peak_mib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1024 if sys.platform != "darwin" else 1024**2)
    print(f"{stage:<44}{seconds:>9.2f} s{seconds / cells * 1e3:>9.3f} ms each{peak_mib:>9.0f} MiB", flush=True)
    return result


def plan_of(cells: int, seeds: int) -> Plan:
    """Return a plan with combinations of filters, adaptations and values of `noise.accel_mps2`."""
    names = {"attitude": "tilt", "engine": "compiled"}
    values = range(-(-cells // (len(FILTERS) * len(ADAPTATIONS))))
    made = []
    for model in FILTERS:
        for adaptation in ADAPTATIONS:
            for value in values:
                spec: dict[str, Any] = {kind: {"name": name} for kind, name in names.items()}
                spec |= {"dataset": {"name": "field"}, "disturbance": [{"name": "none"}]}
                spec |= {
                    "filter": {"name": model, "accel_mps2": 0.01 * (value + 1)},
                    "adaptation": {"name": adaptation},
                }
                cell = build(spec, Protocol(seeds=seeds))
                made.append(replace(cell, labels=cell.labels._replace(noise=f"accel_mps2={0.01 * (value + 1):.2f}")))
    return planned(made[:cells])


def blocks(plan: Plan) -> Iterator[RowBlock]:
    """Yield synthetic rows: the rows of one run, with each metric multiplied by a random factor."""
    (model,), notes = job_rows(plan.jobs[0], [0])
    metrics = {name: value for name, value in model.items() if isinstance(value, float)}
    rng, made_by = np.random.default_rng(1), origin()
    for job in plan.jobs:
        factors = rng.lognormal(0.0, 0.1, (len(job.draws), len(metrics)))
        rows = [
            {**model, **job.labels._asdict(), "seed": seed, **dict(zip(metrics, own, strict=True))}
            for seed, own in zip(job.draws, factors * list(metrics.values()), strict=True)
        ]
        yield from blocks_of(Task((job,), job.draws), [(rows, notes)], made_by)


def store_all(plan: Plan, store: Store) -> None:
    """Store the rows in parts of `BUNDLE` combinations."""
    held: list[RowBlock] = []
    for block in blocks(plan):
        held.append(block)
        if len(held) == BUNDLE:
            store.write([table_of(held)])
            held = []
    if held:
        store.write([table_of(held)])


def main() -> None:
    """Measure all stages and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=10_000)
    parser.add_argument("--seeds", type=int, default=4)
    chosen = parser.parse_args()
    n = chosen.cells
    with tempfile.TemporaryDirectory() as place:
        store = Store(Path(place))
        plan = tell("planned", n, lambda: plan_of(n, chosen.seeds))
        tell("generated and stored", n, lambda: store_all(plan, store))
        tell("looked up", n, lambda: store.known(plan.draws))
        tell("looked up again", n, lambda: store.known(plan.draws))
        tell("parts joined", n, store.compact)
        tell("manifest written", n, lambda: write_manifest(Path(place), plan.draws, [], ["jerkbench"]))
        study = tell("rows read", n, lambda: load_study(Path(place)))
        size = sum(path.stat().st_size for path in store.folder.iterdir())
        print(f"{size / len(study.rows):.0f} bytes a row on the disk, {len(study.rows)} rows")
        table = tell("rows.csv and tables written", n, lambda: write_study(study))
        with contextlib.redirect_stdout(io.StringIO()):
            printed = time.process_time()
            print_table(table, Path(place), max_rows=MAX_ROWS)
            printed = time.process_time() - printed
        print(f"{'table printed':<44}{printed:>9.2f} s")


if __name__ == "__main__":
    main()
