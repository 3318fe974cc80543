"""Every figure of a study, and the errors over time, made in processes of their own: scenarios side by side."""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.errors import JerkbenchError
from jerkbench.execution.pool import run_grouped
from jerkbench.execution.progress import Progress
from jerkbench.files import write_atomically
from jerkbench.report.page.traces import Stretch
from jerkbench.report.plots.picture import Picture
from jerkbench.report.tables.summary import main_metric
from jerkbench.results.scenario_runs import load_scene, scene_keys
from jerkbench.results.study import Study
from jerkbench.results.study_figures.drawings import Drawing, of_rows, of_scene
from jerkbench.results.study_figures.traces import load_stretch, steps_of

if TYPE_CHECKING:
    import pandas as pd

LIMIT = 20
"""Scenarios whose runs are drawn, unless asked otherwise."""


@dataclass(frozen=True, eq=False)
class Job:
    """The figures of all rows, or of one scenario.

    Attributes:
        out: folder of the files; None: there are none.
        study: folder of the cells.
        scenario: its name; empty: all rows.
        keys: of its cells.
        metric: by which runs are chosen.
        rows: of the whole study.
        steps: of each error over time; 0: none is wanted.
    """

    out: Path | None
    study: Path
    scenario: str
    keys: tuple[str, ...]
    metric: str
    rows: "pd.DataFrame | None" = None
    steps: int = 0


@dataclass(frozen=True, eq=False)
class Drawn:
    """What a report shows of runs.

    Attributes:
        pictures: the figures.
        stretches: errors over time, of each scenario.
    """

    pictures: tuple[Picture, ...] = ()
    stretches: tuple[Stretch, ...] = ()


def draw_study(study: Study, out: Path | None, limit: int, workers: int, *, traces: bool = True) -> Drawn:
    """Draw the figures of a study: those of all its rows, then those of up to ``limit`` scenarios' runs.

    A scenario that cannot be run again is told on standard error.

    Args:
        study: the study.
        out: folder for a PNG and a PDF of each; None: no files.
        limit: how many scenarios.
        workers: number of processes.
        traces: whether the errors over time of its cells are wanted too.
    """
    metric, scenes = main_metric(study.rows), scene_keys(study, limit)
    steps = steps_of(scenes.values()) if traces else 0
    jobs = [Job(out, study.folder, name, keys, metric, steps=steps) for name, keys in scenes.items()]
    jobs.insert(0, Job(out, study.folder, "", (), metric, study.rows))
    done: dict[str, Drawn] = {}
    with Progress(len(jobs), doing="Figures", unit="sets of figures") as progress:
        for job, result in run_grouped(draw, [[job] for job in jobs], workers):
            if isinstance(result, Exception):
                raise result
            done[job.scenario] = result
            progress.advance()
    return Drawn(
        tuple(picture for job in jobs for picture in done[job.scenario].pictures),
        tuple(stretch for job in jobs for stretch in done[job.scenario].stretches),
    )


def draw(job: Job) -> Drawn:
    """Draw the figures of ``job``; none where its runs cannot be run again, which is told on standard error."""
    try:
        return Drawn(tuple(_picture(drawing, job) for drawing in _drawings(job)), tuple(_stretches(job)))
    except JerkbenchError as error:
        print(f"jerkbench: no figures of {job.scenario}: {error}", file=sys.stderr)
        return Drawn()


def _stretches(job: Job) -> Iterator[Stretch]:
    if job.keys and job.steps:
        found = load_stretch(job.study, job.scenario, job.keys, job.metric, job.steps)
        if found is not None:
            yield found


def _drawings(job: Job) -> Iterator[Drawing]:
    if job.rows is not None:
        return of_rows(job.rows)
    return of_scene(load_scene(job.study, job.scenario, job.keys, job.metric))


def _picture(drawing: Drawing, job: Job) -> Picture:
    """Render a figure once for the page and the file, and once more as PDF where files are wanted."""
    from jerkbench.report.plots.figures import png_bytes, save_pdf

    png = png_bytes(drawing.figure)
    if job.out is not None:
        write_atomically(job.out / f"{drawing.name}.png", lambda path: path.write_bytes(png))
        save_pdf(drawing.figure, job.out / f"{drawing.name}.pdf")
    return Picture(drawing.name, drawing.caption, job.scenario, png)
