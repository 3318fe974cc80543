"""One job: a single run, or one cell of a sweep that another launcher has started."""

import sys
from pathlib import Path
from typing import Any

from hydra.conf import HydraConf
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from jerkbench.cells.refusal import refusal
from jerkbench.errors import PluginError
from jerkbench.execution.data_mistakes import first_mistakes
from jerkbench.execution.inputs import shared_inputs
from jerkbench.execution.notes import first_remarks
from jerkbench.execution.pulse import Pulse, duration
from jerkbench.hydra_app.configuration import cell_of, check_options, study_folder
from jerkbench.hydra_app.dry_run import tell
from jerkbench.hydra_app.launched_order import note_place
from jerkbench.hydra_app.single_run import draw_single, prepare_drawing, run_single, show_single
from jerkbench.hydra_app.words import cluster_of
from jerkbench.report.choice import Choice, figures_choice
from jerkbench.results.store import Store
from jerkbench.sweep.sweep import Plan, plan_sweep, run_sweep


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
        run_sweep(plan, Store(folder), 1, shown=False)
    else:
        _run_and_show(plan, folder, config)


def _run_and_show(plan: Plan, folder: Path, config: DictConfig) -> None:
    (planned,) = plan.cells
    drawing = figures_choice(config.figures) is not Choice.NONE
    if drawing:
        prepare_drawing(planned.cell)
    with Pulse(lambda seconds: f"Running for {duration(seconds)}."):
        stored = run_single(plan, folder)
    show_single(plan, stored, config)
    for path in draw_single(planned, folder, pdf=config.figures_pdf) if drawing else ():
        print(f"Figure: {path}")
