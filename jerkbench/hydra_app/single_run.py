"""A single run, a job of another launcher's sweep, a trajectory that is scored: one cell, its metrics, its figures."""

import os
import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra.conf import HydraConf
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from jerkbench.contracts import Estimator, Preparing
from jerkbench.errors import PluginError
from jerkbench.estimate import Estimate
from jerkbench.hydra_app.configuration import cell_of, check_options, study_folder
from jerkbench.hydra_app.launched_sweep import note_place, tell
from jerkbench.hydra_app.words import Words, cluster_of
from jerkbench.jobs.cell import Cell
from jerkbench.jobs.inputs import shared_inputs
from jerkbench.jobs.names import refusal
from jerkbench.jobs.preflight import first_mistakes
from jerkbench.jobs.progress import Progress, Pulse, duration
from jerkbench.jobs.rows import CellRun, first_remarks
from jerkbench.recording import Recording
from jerkbench.report.choice import Choice, figures_choice
from jerkbench.results.content import Stored
from jerkbench.results.manifest import stretches, write_manifest
from jerkbench.results.store import Store
from jerkbench.results.study import load_study, write_study
from jerkbench.results.titles import file_stem, with_title
from jerkbench.sweep.sweep import Plan, plan_sweep, run_sweep
from jerkbench.sweep.tasks import Planned

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def run_only_cell(plan: Plan, folder: Path) -> Stored:
    """Run the only cell of a plan, as far as it is not done; returns it as it is stored.

    What is wrong with the input or a plugin ends the run with a sentence, and the cell is not stored.
    """
    store = Store(folder)
    run_sweep(plan, store, strict=True, progress=Progress(0), threads=os.cpu_count() or 1)
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


# One job: a single run, or one cell of a sweep that another launcher has started.


def run_job(config: DictConfig, job: HydraConf) -> None:
    """Run it; what is wrong with an option, or with the combination, is a JerkbenchError."""
    check_options(config)
    cluster_of(config)  # not needed here; an option that it has not is refused all the same
    plain: Any = OmegaConf.to_container(config, resolve=True)
    cell = cell_of(plain, job.runtime.choices, list(job.overrides.task))
    sweeping = job.mode == RunMode.MULTIRUN
    if reason := refusal(cell):
        if not sweeping:
            raise PluginError(f"This combination makes no sense: {reason}.")
        print(f"Left out: {reason}.", file=sys.stderr)
        return
    plan = plan_sweep([cell])
    (planned,) = plan.cells
    mistakes = first_mistakes([planned.cell], shared_inputs())
    for line in (*mistakes, *first_remarks([(planned.cell, planned.fingerprint)], shared_inputs())):
        print(line, file=sys.stderr)
    folder = study_folder(config)
    if config.dry:
        tell(plan, Store(folder), config)
    elif sweeping:
        note_place(folder, int(job.job.num), planned)
        run_sweep(plan, Store(folder), progress=Progress(0))
    else:
        _run_and_show(plan, folder, config)


def _run_and_show(plan: Plan, folder: Path, config: DictConfig) -> None:
    (planned,) = plan.cells
    drawing = figures_choice(config.figures) is not Choice.NONE
    if drawing:
        prepare_drawing(planned.cell)
    with Pulse(lambda seconds: f"Running for {duration(seconds)}."):
        stored = run_only_cell(plan, folder)
    show_single(plan, stored, config)
    for path in draw_single(planned, folder, pdf=config.figures_pdf) if drawing else ():
        print(f"Figure: {path}")


# Trajectories from elsewhere as a cell of a study: stored, and shown as a single run is.


def score_files(words: Words, pattern: str, label: str, dataset: Mapping[str, Any] | None = None) -> None:
    """Score the files of ``pattern``, store their rows, and print them.

    Args:
        words: the recording, the protocol and the study.
        pattern: a file, or one for each seed.
        label: what tables call the method; empty: the file's name.
        dataset: parameters of the data set beside its words.

    Raises:
        JerkbenchError: a file cannot be scored; nothing is stored then.
    """
    cell = words.cell(dataset or {}, file=pattern, label=label)
    if reason := refusal(cell):
        raise PluginError(f"This combination makes no sense: {reason}.")
    plan, folder = plan_sweep([cell]), study_folder(words.config)
    show_single(plan, run_only_cell(plan, folder), words.config)
    print(f"\nRows, tables and manifest: {folder}")
