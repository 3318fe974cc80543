"""A single run: one cell, its metrics in the terminal, its trajectory and its errors as figures."""

import os
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from omegaconf import DictConfig

from jerkbench.cells.cell import Cell
from jerkbench.contracts import Estimator, Preparing
from jerkbench.estimate import Estimate
from jerkbench.execution.cell_run import CellRun
from jerkbench.hydra_app.configuration import study_folder
from jerkbench.recording import Recording
from jerkbench.results.content import Stored
from jerkbench.results.manifest import stretches, write_manifest
from jerkbench.results.store import Store
from jerkbench.results.study import load_study, write_study
from jerkbench.results.titles import file_stem, with_title
from jerkbench.sweep.sweep import Plan, run_sweep
from jerkbench.sweep.tasks import Planned

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def run_single(plan: Plan, folder: Path) -> Stored:
    """Run the only cell of a plan, as far as it is not done; returns it as it is stored.

    What is wrong with the input or a plugin ends the run with a sentence, and the cell is not stored.
    """
    store = Store(folder)
    run_sweep(plan, store, 1, strict=True, shown=False, threads=os.cpu_count() or 1)
    (stored,), _ = store.read(plan.draws, {key: stretches(own) for key, own in plan.draws.items()})
    return stored


def show_single(plan: Plan, stored: Stored, config: DictConfig) -> None:
    """Print rows and notes at once, for files and figures take longer than the run; then write the study."""
    from jerkbench.report.tables.terminal import print_run

    folder = study_folder(config)
    print_run(stored.rows)
    for note in stored.metadata["notes"]:
        print(note, flush=True)
    write_manifest(folder, plan.draws, list(config.notes), sys.argv, tags=list(config.tags))
    write_study(load_study(folder, prefer=list(plan.draws)))


def prepare_drawing(cell: Cell) -> None:
    """Let the engine begin with what a trajectory needs and sums do not: to compile it takes as long as all else."""
    if isinstance(cell.engine, Preparing) and not isinstance(cell.filter, Estimator):
        cell.engine.prepare(cell.filter)


def draw_single(planned: Planned, folder: Path, *, pdf: bool = False) -> list[Path]:
    """Draw trajectory and errors of the first seed; returns the files."""
    recording, estimate = CellRun(planned.cell, planned.fingerprint).once(planned.draws[0])
    titled = with_title(recording, planned.cell, planned.draws[0])
    return draw_run(planned.cell, titled, estimate, folder / "figures", pdf=pdf)


def draw_run(cell: Cell, recording: Recording, estimate: Estimate, folder: Path, *, pdf: bool = False) -> list[Path]:
    """Draw the trajectory and the errors of one run, with the recording's name above; returns the files."""
    from jerkbench.report.plots.errors_over_time import error_figure, inclination_figure
    from jerkbench.report.plots.style import save_figure
    from jerkbench.report.plots.trajectory import trajectory_figure

    labels = cell.labels
    estimates = {f"{labels.filter} + {labels.adaptation}": estimate}
    name = file_stem(labels)
    errors = partial(error_figure, burn_in_s=cell.protocol.burn_in_s)
    drawn: dict[str, Callable[..., Figure]] = {"trajectory": trajectory_figure, "errors": errors}
    if estimate.attitude_only:
        drawn = {"inclination": inclination_figure}
    paths = []
    for kind, draw in drawn.items():
        figure = draw(recording, estimates)
        for ending in ("png", "pdf") if pdf else ("png",):
            paths.append(folder / f"{name}-{kind}.{ending}")
            save_figure(figure, paths[-1])
    return paths
