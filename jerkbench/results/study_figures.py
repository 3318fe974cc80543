"""The figures of a study, made in processes of their own, scenarios side by side; its report."""

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.errors import JerkbenchError
from jerkbench.files import write_atomically, write_text
from jerkbench.jobs.cluster import Workers
from jerkbench.jobs.dispatch import Order, outcomes
from jerkbench.jobs.progress import Progress
from jerkbench.report.analysis.columns import METHOD, SCENARIO_FACTORS
from jerkbench.report.analysis.runs import RULE, VerdictRule
from jerkbench.report.choice import Choice
from jerkbench.report.drawings import (
    Drawing,
    Methods,
    Picture,
    by_difference,
    of_rows,
    of_scene,
    palette_of,
    telling_scenes,
)
from jerkbench.report.page.script_data import Stretch
from jerkbench.report.plots.style import Palette
from jerkbench.report.tables.summary import main_metric
from jerkbench.results.manifest import read_manifest
from jerkbench.results.scenario_runs import SceneCells, load_scene, load_stretch, scene_cells, steps_of
from jerkbench.results.selection import named_part
from jerkbench.results.store import Store
from jerkbench.results.study import Study

if TYPE_CHECKING:
    import pandas as pd

FIGURES, REPORT = "figures", "report.html"
PROVENANCE = ("command", "finished", "commit", "versions", "host")
"""Entries of the manifest that the report shows."""

OTHERWISE = {
    Choice.FEW: "figures=all draws those of every scenario, figures=none leaves them out",
    Choice.ALL: "figures=few draws those that carry a finding, figures=none leaves them out",
}
"""What one can ask for instead."""

LIMIT = 20
"""Scenarios whose runs are drawn at most, unless asked otherwise."""


@dataclass(frozen=True, eq=False)
class Request:
    """Which figures of a study are wanted.

    Attributes:
        choice: of which scenarios.
        limit: of so many scenarios at most.
        out: folder for a PNG of each; None: no files.
        pdf: whether each is a PDF, too.
        traces: whether the errors over time of its cells are wanted, of all scenarios up to the limit.
        run_programs: whether programs that stored cells name may run; without it their cells are left out.
        methods: names of those that are drawn; none: of the study's those that tell something.
        scenarios: names of those that are drawn; none: as the choice says.
        seed: the run of a scenario that is drawn; None: the first.
    """

    choice: Choice = Choice.FEW
    limit: int = LIMIT
    out: Path | None = None
    pdf: bool = False
    traces: bool = True
    run_programs: bool = False
    methods: Sequence[str] = ()
    scenarios: Sequence[str] = ()
    seed: int | None = None


@dataclass(frozen=True, eq=False)
class Picturing:
    """The figures of all rows, or of one scenario.

    Attributes:
        request: what is wanted.
        study: folder of the cells.
        scenario: its name; empty: all rows.
        cells: its cells.
        metric: by which runs are chosen.
        palette: of the study.
        rows: of the whole study.
        methods: that its figures show; None: it has no figures; none: the usual ones.
        steps: of each error over time; 0: none is wanted.
    """

    request: Request
    study: Path
    scenario: str
    cells: SceneCells
    metric: str
    palette: Palette
    rows: "pd.DataFrame | None" = None
    methods: Methods | None = None
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


def draw_study(study: Study, request: Request, workers: int) -> Drawn:
    """Draw the figures of a study: those of all its rows, then those of its scenarios' runs.

    A scenario that cannot be run again is told on standard error.

    Args:
        study: the study.
        request: which of them.
        workers: number of processes.

    Raises:
        JerkbenchError: the study has no such method, scenario or seed.
    """
    if request.choice is Choice.NONE:
        return Drawn()
    jobs = _jobs(study, request)
    done: dict[str, Drawn] = {}
    slowest_first = sorted(jobs, key=lambda job: job.methods is None and job.rows is None)
    with Progress(len(jobs), doing="Figures", unit="sets of figures") as progress, Workers(count=workers) as processes:
        order = Order(draw, [[job] for job in slowest_first])
        for job, result in outcomes(order, processes.lent(len(jobs))):
            if isinstance(result, Exception):
                raise result
            done[job.scenario] = result
            progress.advance()
    return Drawn(
        tuple(picture for job in jobs for picture in done[job.scenario].pictures),
        tuple(stretch for job in jobs for stretch in done[job.scenario].stretches),
    )


def _jobs(study: Study, request: Request) -> list[Picturing]:
    """Return what is to be done, in the order in which it is shown."""
    metric, palette = main_metric(study.rows), palette_of(study.rows)
    study = _requested(study, request)
    scenes = scene_cells(study)
    named = tuple(dict.fromkeys(zip(study.rows["filter"], study.rows["adaptation"], strict=True)))
    shown: Mapping[str, Methods] = dict.fromkeys(scenes, named if request.methods else ())
    few = request.choice is Choice.FEW and not (request.methods or request.scenarios)
    if few or (len(scenes) > request.limit and not request.scenarios):
        ranked = dict(list(by_difference(study.rows, metric, list(scenes)).items())[: request.limit])
        scenes = {name: cells for name, cells in scenes.items() if name in ranked}
        shown = telling_scenes(ranked) if few else shown
    steps = steps_of(scenes.values()) if request.traces else 0
    return [
        Picturing(request, study.folder, "", {}, metric, palette, study.rows),
        *(
            Picturing(request, study.folder, name, cells, metric, palette, methods=shown.get(name), steps=steps)
            for name, cells in scenes.items()
            if steps or name in shown
        ),
    ]


def _requested(study: Study, request: Request) -> Study:
    """Return the part of a study that has the names of the request."""
    for names, factors in ((request.scenarios, SCENARIO_FACTORS), (request.methods, METHOD)):
        study = named_part(study, names, factors) if names else study
    seeds = sorted(set(study.rows["seed"]))
    if request.seed is not None and request.seed not in seeds:
        raise JerkbenchError(f"There is no seed {request.seed}; the smallest is {seeds[0]}, the largest {seeds[-1]}.")
    return study


def draw(job: Picturing) -> Drawn:
    """Draw the figures of ``job``; none where its runs cannot be run again, which is told on standard error."""
    programs = job.request.run_programs
    try:
        pictures = tuple(_picture(drawing, job) for drawing in _drawings(job))
        stretch = None
        if job.cells and job.steps:
            stretch = load_stretch(job.study, job.scenario, job.cells, job.metric, job.steps, run_programs=programs)
        return Drawn(pictures, (stretch,) if stretch else ())
    except JerkbenchError as error:
        print(f"jerkbench: no figures of {job.scenario}: {error}", file=sys.stderr)
        return Drawn()


def _drawings(job: Picturing) -> Iterator[Drawing]:
    if job.rows is not None:
        yield from of_rows(job.rows, job.palette)
    elif job.methods is not None:
        seed, programs = job.request.seed, job.request.run_programs
        where = job.study, job.scenario, job.cells
        yield from of_scene(load_scene(*where, job.metric, job.methods, seed, run_programs=programs), job.palette)


def _picture(drawing: Drawing, job: Picturing) -> Picture:
    """Render a figure once for the page and the file, and once more as PDF where that is wanted."""
    from jerkbench.report.plots.style import png_bytes, save_pdf

    png = png_bytes(drawing.figure)
    out = job.request.out
    if out is not None:
        write_atomically(out / f"{drawing.name}.png", lambda path: path.write_bytes(png))
        if job.request.pdf:
            save_pdf(drawing.figure, out / f"{drawing.name}.pdf")
    return Picture(drawing.name, drawing.caption, job.scenario, png)


def present(study: Study, workers: int, choice: Choice, *, pdf: bool = False, run_programs: bool = False) -> None:
    """Draw the figures of a study and write its report; say so before, because it takes a while.

    Args:
        study: the study.
        workers: number of processes.
        choice: which figures.
        pdf: whether each is a PDF, too.
        run_programs: whether programs of stored cells may run; without it they are left out.
    """
    drawn = Drawn()
    if choice is not Choice.NONE:
        print(f"Drawing the figures ({OTHERWISE[choice]}).", flush=True)
        drawn = draw_study(
            study, Request(choice, out=study.folder / FIGURES, pdf=pdf, run_programs=run_programs), workers
        )
        print(f"Figures: {study.folder / FIGURES}")
    write_report(study, drawn, study.folder / REPORT)
    print(f"Report: {study.folder / REPORT}")


def write_report(
    study: Study, drawn: Drawn, path: Path, method: tuple[str, ...] | None = None, rule: VerdictRule = RULE
) -> None:
    """Write the report of a study as one HTML file, its methods made of ``method`` and judged by ``rule``."""
    from jerkbench.report.page.page import Results, page

    stored, _ = Store(study.folder).read(list(dict.fromkeys(study.keys)))
    manifest, labels = read_manifest(study.folder), study.labels
    results = Results(
        name=study.folder.resolve().name,
        rows=study.rows,
        keys=list(study.keys),
        about={cell.key: {**cell.metadata, "labels": labels[cell.key]} for cell in stored},
        notes=study.notes,
        provenance={key: manifest[key] for key in PROVENANCE if key in manifest},
        rule=rule,
        method=method,
    )
    write_text(path, page(results, drawn.pictures, drawn.stretches))
