"""The figures of a single run: its trajectory and its errors, or its inclination."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.contracts import Estimator, Preparing
from jerkbench.estimate import Estimate
from jerkbench.jobs.job import Job
from jerkbench.jobs.rows import run_seed
from jerkbench.recording import Recording
from jerkbench.results.titles import file_stem, with_title

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def prepare_drawing(job: Job) -> None:
    """Let the engine begin with what a trajectory needs and sums do not: to compile it takes as long as all else."""
    engine, model = job.method.engine, job.method.filter
    if isinstance(engine, Preparing) and not isinstance(model, Estimator):
        engine.prepare(model)


def draw_single(job: Job, folder: Path, *, pdf: bool = False) -> list[Path]:
    """Draw trajectory and errors of the first seed; returns the files."""
    recording, estimate = run_seed(job, job.draws[0])
    return draw_run(job, with_title(recording, job, job.draws[0]), estimate, folder / "figures", pdf=pdf)


def draw_run(job: Job, recording: Recording, estimate: Estimate, folder: Path, *, pdf: bool = False) -> list[Path]:
    """Draw the trajectory and the errors of one run, with the recording's name above; returns the files."""
    from jerkbench.report.plots.errors_over_time import error_figure, inclination_figure
    from jerkbench.report.plots.style import save_figure
    from jerkbench.report.plots.trajectory import trajectory_figure

    labels = job.labels
    estimates = {f"{labels.filter} + {labels.adaptation}": estimate}
    name = file_stem(labels)
    errors = partial(error_figure, burn_in_s=job.scoring.burn_in_s)
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
