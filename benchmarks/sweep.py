"""CPU time per run of each stage of a sweep over the data set `field` (150 s at 100 Hz).

    python benchmarks/sweep.py [--seeds 32]

The script measures the CPU time of one process and divides the CPU time by the number of runs. The filters are compiled
before the measurement. Stages marked "once a recording" are computed once for each data set, disturbance and seed. All
filters, adaptations and noise presets of a sweep use the result.
"""

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from jerkbench.evaluation.evaluated_run import prepare_reference
from jerkbench.jobs.job import Job, Protocol, build
from jerkbench.jobs.rows import Inputs, Task, attitude_of, job_rows, simulated
from jerkbench.jobs.run import blocks_of, origin
from jerkbench.jobs.store import Store, table_of
from jerkbench.timeline import build_timeline

ONCE, EACH = "once a recording", "each run"
CHOICES = [(model, adaptation) for model in ("jerk", "baseline") for adaptation in ("none", "mtf", "sage_husa")]


def job_of(model: str, adaptation: str, seeds: int) -> Job:
    """Return the job of a filter with an adaptation."""
    names = {"dataset": "field", "attitude": "tilt", "filter": model, "adaptation": adaptation, "engine": "compiled"}
    spec: dict[str, Any] = {kind: {"name": name} for kind, name in names.items()}
    return build({**spec, "disturbance": [{"name": "multipath_single_axis"}]}, Protocol(seeds=seeds))


def tell(name: str, paid: str, runs: int, work: Callable[[], object]) -> None:
    """Execute ``work`` and print its CPU time per run."""
    begin = time.process_time()
    work()
    print(f"{name:<44}{(time.process_time() - begin) / runs * 1e3:>9.2f} ms   {paid}", flush=True)


def tell_recordings(job: Job) -> None:
    """Measure the stages before the filter."""
    data, seeds = job.scenario.dataset, job.draws
    tell("simulated", "once, then stored in the cache", len(seeds), lambda: [data.load(seed) for seed in seeds])
    kept = [simulated(data, seed) for seed in seeds]
    tell("read from the disk", ONCE, len(seeds), lambda: [simulated(data, seed) for seed in seeds])
    inputs = Inputs()
    changed = [inputs.recording(job.scenario, seed) for seed in seeds]
    (disturbance,) = job.scenario.disturbances
    pairs = list(zip(kept, seeds, strict=True))
    tell("disturbed", ONCE, len(seeds), lambda: [disturbance.apply(recording, seed) for recording, seed in pairs])
    tell("attitude", ONCE, len(seeds), lambda: [attitude_of(recording, job.scenario.attitude) for recording in changed])
    attitudes = [attitude_of(recording, job.scenario.attitude) for recording in changed]
    both = list(zip(changed, attitudes, strict=True))
    tell("timeline", ONCE, len(seeds), lambda: [build_timeline(*pair) for pair in both])
    lines = [(recording, build_timeline(recording, attitude), job.protocol.burn_in_s) for recording, attitude in both]
    tell("weights of the errors", ONCE, len(seeds), lambda: [prepare_reference(*line) for line in lines])


def tell_cells(seeds: int) -> None:
    """Measure the filters and the metrics of each combination, and the store.

    The time of the first combination includes the data that all combinations use.
    """
    for model, adaptation in CHOICES:
        job = job_of(model, adaptation, seeds)
        tell(f"{model}, {adaptation}: filtered and scored", EACH, seeds, lambda job=job: job_rows(job))  # type: ignore[misc]  # mypy does not support defaults in a lambda
    (block,) = blocks_of(Task((job,), job.draws), [job_rows(job)], origin())
    first, *others = [block._replace(key=f"{k:064x}") for k in range(101)]
    with tempfile.TemporaryDirectory() as folder:
        store = Store(Path(folder))
        store.write([table_of([first])])
        store.known([first.key])
        keys = [block.key for block in others]
        tell("stored", "each combination", len(keys), lambda: [store.write([table_of([block])]) for block in others])
        tell("looked up and checked", "each stored combination", len(keys), lambda: store.known(set(keys)))


def main() -> None:
    """Measure all stages and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=32, help="number of runs")
    seeds = parser.parse_args().seeds
    for model, adaptation in CHOICES:
        job_rows(job_of(model, adaptation, 1))
    tell_recordings(job_of("jerk", "none", seeds))
    job_rows(job_of("jerk", "none", seeds))
    tell_cells(seeds)


if __name__ == "__main__":
    main()
