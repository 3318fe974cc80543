"""One job: a single run, or one cell of a sweep that another launcher has started."""

import sys
from pathlib import Path
from typing import Any

from hydra.conf import HydraConf
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from jerkbench.cells.refusal import refusal
from jerkbench.errors import PluginError
from jerkbench.execution.cell_run import CellRun
from jerkbench.execution.data_mistakes import first_mistakes
from jerkbench.execution.inputs import shared_inputs
from jerkbench.execution.notes import first_remarks
from jerkbench.execution.pulse import Pulse, duration
from jerkbench.hydra_app.configuration import cell_of, check_options, study_folder
from jerkbench.hydra_app.dry_run import tell
from jerkbench.hydra_app.launched_order import note_place
from jerkbench.hydra_app.single_run import draw_single, prepare_drawing, run_single_cell
from jerkbench.hydra_app.words import cluster_of
from jerkbench.results.manifest import write_manifest
from jerkbench.results.store import Store
from jerkbench.results.study import load_study, write_study
from jerkbench.results.study_figures.choice import Choice, figures_choice
from jerkbench.sweep.seed_blocks import finish_cell
from jerkbench.sweep.sweep import Plan, plan_sweep
from jerkbench.sweep.tasks import Planned


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
    (planned,) = plan_sweep([cell]).cells
    mistakes = first_mistakes([planned.cell], shared_inputs())
    for line in (*mistakes, *first_remarks([(planned.cell, planned.fingerprint)], shared_inputs())):
        print(line, file=sys.stderr)
    folder = study_folder(config)
    if config.dry:
        tell(Plan((planned,), ()), Store(folder), config)
        return
    if not sweeping:
        _run_and_show(planned, folder, config)
        return
    note_place(folder, int(job.job.num), planned.key)
    if not Store(folder).done(planned.key):
        finish_cell(planned, Store(folder), CellRun(planned.cell, planned.fingerprint).pieces)


def _run_and_show(planned: Planned, folder: Path, config: DictConfig) -> None:
    from jerkbench.report.tables.terminal import print_run

    Store(folder).prepare()
    drawing = figures_choice(config.figures) is not Choice.NONE
    if drawing:
        prepare_drawing(planned.cell)
    with Pulse(lambda seconds: f"Running for {duration(seconds)}."):
        stored = run_single_cell(planned, folder)
    print_run(stored.rows)  # at once: files and figures take longer than the run
    for note in stored.metadata["notes"]:
        print(note, flush=True)
    write_manifest(folder, [planned.key], list(config.notes), sys.argv, tags=list(config.tags))
    write_study(load_study(folder, prefer=[planned.key]))
    for path in draw_single(planned, folder, pdf=config.figures_pdf) if drawing else ():
        print(f"Figure: {path}")
