"""The time of a sweep by its stages: what each costs a run of `field`, 150 s at 100 Hz.

    python benchmarks/sweep.py [--seeds 32]

CPU times of one process, divided by the number of runs; everything is compiled before. What is made once a recording
(of a data set, disturbance and seed) is shared by every filter, adaptation and noise of a sweep.
"""

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from jerkbench.evaluation.sums import scored
from jerkbench.jobs.cell import Cell, Protocol, build
from jerkbench.jobs.inputs import Inputs, attitude_of, simulated
from jerkbench.jobs.rows import CellRun
from jerkbench.results.store import Store
from jerkbench.sweep.tasks import Planned, Result, block_of
from jerkbench.timeline import build_timeline

ONCE, EACH = "once a recording", "each run"
CHOICES = [(model, adaptation) for model in ("jerk", "baseline") for adaptation in ("none", "mtf", "sage_husa")]


def cell_of(model: str, adaptation: str, seeds: int) -> Cell:
    """The cell of a filter with an adaptation."""
    names = {"dataset": "field", "attitude": "tilt", "filter": model, "adaptation": adaptation, "engine": "compiled"}
    spec: dict[str, Any] = {kind: {"name": name} for kind, name in names.items()}
    return build({**spec, "disturbance": [{"name": "multipath_single_axis"}]}, Protocol(seeds=seeds))


def tell(name: str, paid: str, runs: int, work: Callable[[], object]) -> None:
    """Print how long ``work`` takes, by run."""
    begin = time.process_time()
    work()
    print(f"{name:<44}{(time.process_time() - begin) / runs * 1e3:>9.2f} ms   {paid}", flush=True)


def tell_recordings(cell: Cell) -> None:
    """The way of the data up to the filter."""
    data, seeds = cell.dataset, cell.draws
    tell("simulated", "once, then kept on the disk", len(seeds), lambda: [data.load(seed) for seed in seeds])
    kept = [simulated(data, seed) for seed in seeds]
    tell("read from the disk", ONCE, len(seeds), lambda: [simulated(data, seed) for seed in seeds])
    inputs = Inputs()
    changed = [inputs.recording(cell, "", seed) for seed in seeds]
    (disturbance,) = cell.disturbances
    pairs = list(zip(kept, seeds, strict=True))
    tell("disturbed", ONCE, len(seeds), lambda: [disturbance.apply(recording, seed) for recording, seed in pairs])
    tell("attitude", ONCE, len(seeds), lambda: [attitude_of(recording, cell.attitude) for recording in changed])
    attitudes = [attitude_of(recording, cell.attitude) for recording in changed]
    both = list(zip(changed, attitudes, strict=True))
    tell("timeline", ONCE, len(seeds), lambda: [build_timeline(*pair) for pair in both])
    lines = [(recording, build_timeline(recording, attitude), cell.protocol.burn_in_s) for recording, attitude in both]
    tell("what the errors count for", ONCE, len(seeds), lambda: [scored(*line) for line in lines])


def tell_cells(seeds: int) -> None:
    """Filters and metrics of whole cells, the first one with what they share; then the store."""
    for model, adaptation in CHOICES:
        cell = cell_of(model, adaptation, seeds)
        tell(f"{model}, {adaptation}: filtered and scored", EACH, seeds, lambda cell=cell: CellRun(cell, "").rows())  # type: ignore[misc]  # mypy knows no default in a lambda
    rows, notes = CellRun(cell, "").rows()
    cells = [Planned(cell, f"{k:064x}", "", cell.draws) for k in range(101)]
    first, *others = [block_of(planned, Result(rows, notes, 0.0)) for planned in cells]
    with tempfile.TemporaryDirectory() as folder:
        store = Store(Path(folder))
        store.write_blocks([first])
        store.known([first.key])
        keys = [block.key for block in others]
        tell("stored", "each cell", len(keys), lambda: [store.write_blocks([block]) for block in others])
        tell("looked up and checked", "each cell that is done", len(keys), lambda: store.known(keys))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=32, help="how many runs each time is the mean of")
    seeds = parser.parse_args().seeds
    for model, adaptation in CHOICES:
        CellRun(cell_of(model, adaptation, 1), "").rows()
    tell_recordings(cell_of("jerk", "none", seeds))
    CellRun(cell_of("jerk", "none", seeds), "").rows()
    tell_cells(seeds)


if __name__ == "__main__":
    main()
