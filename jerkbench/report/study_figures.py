"""Draw the figures of a study and write its report.

To draw the figures, some runs of each scenario are repeated in parallel processes.
"""

import base64
import hashlib
import io
import math
import re
import sys
import textwrap
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jerkbench import plugins
from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.counted_rows import position_error_length_m
from jerkbench.files import write_atomically, write_text
from jerkbench.jobs.executors import Workers
from jerkbench.jobs.job import Job
from jerkbench.jobs.key import read_manifest
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.rows import run_seed
from jerkbench.jobs.run import outcomes
from jerkbench.jobs.store import Store, Stored
from jerkbench.jobs.study import Study, named_part, row_of, runnable
from jerkbench.recording import Recording
from jerkbench.report import Choice
from jerkbench.report.columns import METHOD, SCENARIO_FACTORS, competes
from jerkbench.report.comparisons import RULE, VerdictRule
from jerkbench.report.labels import bare
from jerkbench.report.page import largest_of_steps, page
from jerkbench.report.plots import runs
from jerkbench.report.plots.studies import (
    SCENES,
    Drawing,
    Methods,
    Picture,
    by_difference,
    of_rows,
    palette_of,
)
from jerkbench.report.plots.style import Palette, image_of, save_figure
from jerkbench.report.summary import main_metric

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

LIMIT = 20
"""Default for the maximum number of scenarios whose runs are drawn."""

WANTED = (("baseline", "none"), ("jerk", "mtf"), ("jerk", "none"), ("gnss_only", "none"))
"""Methods (filter and adaptation) that are drawn in addition to the best method, if the study contains them."""

SHOWN_METHODS = 6
"""Maximum number of methods in a figure. Methods requested by name may exceed this number."""

FROM_ELSEWHERE = ("command", "trajectory")
"""Builtin filters that count as user plugins, because they run a user program or read a trajectory of other software.
"""

SEEDS = 10
"""Maximum number of runs of the best method whose NEES and NIS are averaged."""

MAX_CURVES = 12
"""Maximum number of jobs of a scenario whose errors over time are shown. Jobs with user plugins come first."""

CURVE_STEPS = 300
"""Number of time steps into which the errors of a recording are divided."""


@dataclass(frozen=True, eq=False)
class Request:
    """A request for figures of a study.

    Attributes:
        choice: value of the option ``figures``, which selects the scenarios whose runs are drawn.
        limit: maximum number of scenarios whose runs are drawn.
        out: folder for the figure files, or None to write no figure files.
        pdf: whether to write PDF files in addition to PNG files.
        traces: whether the report contains errors over time, for at most ``limit`` scenarios.
        run_programs: whether external programs in stored configurations may run. If ``run_programs`` is False, jobs
            with programs are left out.
        methods: names of the methods to draw. If ``methods`` is empty, the best methods are drawn.
        scenarios: names of the scenarios to draw. If ``scenarios`` is empty, ``choice`` selects the scenarios.
        seed: seed of the runs to draw, or None for the first seed.
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


DrawnStudy = tuple[list[Picture], list[dict[str, Any]]]
"""The figures of a study, and the errors over time of its scenarios (see `_curves`)."""


def draw_study(study: Study, request: Request, workers: int) -> DrawnStudy:
    """Draw the figures of a study: figures of the stored rows, then figures of repeated runs of each scenario.

    If the runs of a scenario cannot be repeated, a message is printed on standard error, and the scenario is left out.

    Args:
        study: study with the rows and the stored jobs.
        request: the requested figures.
        workers: number of processes in which figures are drawn.

    Raises:
        JerkbenchError: the study does not contain a requested method, scenario or seed.
    """
    if request.choice is Choice.NONE:
        return [], []
    chunks, done = [[task] for task in enumerate(_drawing_tasks(study, request))], dict[int, DrawnStudy]()
    count = workers if len(chunks) > 2 else 1  # starting processes takes longer than a few figures
    with Progress(len(chunks), doing="Figures", unit="sets of figures") as progress, Workers(count=count) as pool:
        for ((index, _),), drawn in outcomes(_draw_first, chunks, pool.pool(len(chunks))):
            if isinstance(drawn, Exception):
                raise drawn
            done[index] = drawn
            progress.advance()
    pictures, curves = zip(*(done[index] for index in sorted(done)), strict=True)
    return list(chain(*pictures)), list(chain(*curves))


def _draw_first(tasks: Sequence[tuple[int, Callable[[], DrawnStudy]]]) -> tuple[int, DrawnStudy]:
    return 1, tasks[0][1]()


def _drawing_tasks(study: Study, request: Request) -> list[Callable[[], DrawnStudy]]:
    """Return functions without arguments that draw figures: one for the stored rows, then one for each scenario."""
    metric, palette = main_metric(study.rows), palette_of(study.rows)
    of_all_rows = partial(_draw_rows, request, study.rows, palette)
    study = _requested(study, request)
    scenarios: dict[str, dict[str, Mapping[str, str]]] = {}
    for key, labels in study.labels.items():
        scenarios.setdefault(", ".join(labels[factor] for factor in SCENARIO_FACTORS), {})[key] = labels
    named = tuple(dict.fromkeys(zip(study.rows["filter"], study.rows["adaptation"], strict=True)))
    methods = named if request.methods else ()
    few, pictured = request.choice is Choice.FEW, list(scenarios)
    if few or (len(scenarios) > request.limit and not request.scenarios):
        pictured = by_difference(study.rows, metric, list(scenarios))[: request.limit]
        scenarios = {name: labels for name, labels in scenarios.items() if name in pictured}
    pictured = pictured[:SCENES] if few else pictured
    draw = partial(_draw_scenario, request, study.folder, metric, palette)
    tasks = [partial(draw, name, labels, methods if name in pictured else None) for name, labels in scenarios.items()]
    return [of_all_rows, *tasks]


def _requested(study: Study, request: Request) -> Study:
    """Return the part of a study that contains the requested scenarios and methods, and check the requested seed."""
    for names, factors in ((request.scenarios, SCENARIO_FACTORS), (request.methods, METHOD)):
        study = named_part(study, names, factors) if names else study
    seeds = sorted(set(study.rows["seed"]))
    if request.seed is not None and request.seed not in seeds:
        raise JerkbenchError(f"The study has no seed {request.seed}; its seeds are from {seeds[0]} to {seeds[-1]}.")
    return study


def _draw_rows(request: Request, rows: "pd.DataFrame", palette: Palette) -> DrawnStudy:
    return [_picture(drawing, "", request) for drawing in of_rows(rows, palette)], []


def _draw_scenario(
    request: Request,
    folder: Path,
    metric: str,
    palette: Palette,
    name: str,
    labels: Mapping[str, Mapping[str, str]],
    methods: Methods | None,
) -> DrawnStudy:
    """Draw the figures of a scenario, and compute the errors over time for the report.

    ``methods`` are the methods to draw: an empty tuple selects the best methods, and None draws no figures.
    """
    try:
        stored = runnable(Store(folder).read(list(labels))[0], run_programs=request.run_programs)
        jobs = ranked([replace(job, metadata={**job.metadata, "labels": labels[job.key]}) for job in stored], metric)
        drawings = [] if methods is None else _draw_runs(name, jobs, methods, request.seed, palette)
        pictures = [_picture(drawing, name, request) for drawing in drawings]
        return pictures, _curves(name, jobs, palette) if request.traces else []
    except JerkbenchError as error:
        print(f"jerkbench: the figures of {name} were not drawn: {error}", file=sys.stderr)
        return [], []


def _picture(drawing: Drawing, scenario: str, request: Request) -> Picture:
    """Write the requested PNG and PDF files of a figure, and return the encoded figure for the report.

    The report contains lossless WebP images, because they have two thirds of the size of PNG images.
    """
    image, out, data = image_of(drawing.figure), request.out, io.BytesIO()
    if out is not None:
        write_atomically(out / f"{drawing.name}.png", image.save)
    if out is not None and request.pdf:
        drawing.figure.set_layout_engine("none")  # reuse the layout of the PNG, because a new layout is slow
        save_figure(drawing.figure, out / f"{drawing.name}.pdf")
    image.convert("RGB").save(data, "webp", lossless=True, quality=50, method=3)
    encoded_data = f"data:image/webp;base64,{base64.b64encode(data.getvalue()).decode()}"
    return Picture(drawing.name, drawing.caption, scenario, encoded_data, *image.size)


def _draw_runs(
    name: str, jobs: Sequence[Stored], wanted: Methods, seed: int | None, palette: Palette
) -> Iterator[Drawing]:
    """Repeat runs of selected jobs of a scenario, and yield the figures of these runs.

    Raises:
        JerkbenchError: a stored job cannot be run again, for example because its data have changed.
    """
    if not jobs:
        raise JerkbenchError("all methods are stored programs, which run only with --run-programs.")
    selected = _selected(jobs, wanted)
    rows = {method: row_of(job, seed, run_programs=True) for method, job in selected.items()}
    made = {method: row.run() for method, row in rows.items()}
    best, row = next(iter(rows.items()))
    stored = selected[best].rows
    seeds = stored["seed"][(stored["status"] == "ok") & (stored["replicate"] == "seed")].tolist()[:SEEDS]
    of_best = [row_of(selected[best], seed_of_run, run_programs=True).run() for seed_of_run in seeds or [None]]
    recording, estimates = with_title(made[best][0], row.job, row.draw), {name: run[1] for name, run in made.items()}
    updated = {method: estimate for method, estimate in estimates.items() if len(estimate.updates.t_s)}
    errors = partial(runs.error_figure, recording, burn_in_s=row.job.protocol.burn_in_s, palette=palette)
    trajectory = runs.trajectory_figure(recording, estimates, palette)
    figures = {
        "errors": ("position error, first seed", errors(estimates, panels=1)),
        "trajectory": ("trajectory", trajectory),
        "three-sigma": (f"errors of {best} with three sigmas", errors({best: estimates[best]})),
        "consistency": (f"NEES and NIS of {best}", runs.consistency_figure(of_best, best, palette)),
        "adapted-r": ("measurement noise that was used", runs.adapted_r_figure(recording, updated, palette)),
    }
    if recording.imu is not None and recording.reference.euler_rad is not None:
        inclination = runs.inclination_figure(recording, {row.job.labels.attitude: estimates[best]}, palette)
        figures["inclination"] = "inclination error", inclination
    for kind, (caption, figure) in figures.items():
        yield Drawing(f"{file_stem([name])}-{kind}", f"{name}: {caption}.", figure)


def _selected(cells: Sequence[Stored], wanted: Methods) -> dict[str, Stored]:
    """Return the jobs to draw: the best job, the jobs with user plugins, the wanted methods, and further jobs.

    If a method was run with several noise settings, only the best of these jobs is selected.

    Args:
        cells: jobs of a scenario, sorted from best to worst.
        wanted: pairs of filter and adaptation to select. If ``wanted`` is empty, the methods in `WANTED` and the next
            best methods are selected.
    """
    methods: dict[tuple[str, str], Stored] = {}
    for cell in cells:
        methods.setdefault(_method(cell), cell)
    best, *others = methods
    of_user = [method for method, cell in methods.items() if is_of_user(cell.metadata["spec"])]
    known = [method for method in wanted or WANTED if method in methods]
    most = len(methods) if wanted else SHOWN_METHODS
    places = list(dict.fromkeys([best, *of_user[: SHOWN_METHODS - 1], *known, *([] if wanted else others)]))
    return {_name(methods[key]): methods[key] for key in places[:most]}


def is_of_user(spec: Mapping[str, Any]) -> bool:
    """Return whether the filter or the adaptation of a stored job is a user plugin.

    A user plugin is a plugin of another package, an external program, or a trajectory from other software.
    """
    parts = [(kind, str(spec[kind]["name"])) for kind in ("filter", "adaptation")]
    known = [(kind, name) for kind, name in parts if name in plugins.names(kind)]
    return any(name in FROM_ELSEWHERE or not plugins.is_builtin(plugins.get(kind, name)) for kind, name in known)


def ranked(group: Sequence[Stored], metric: str) -> list[Stored]:
    """Return the jobs of a scenario, sorted by the mean of the metric.

    Reference methods, such as the oracle, come last.
    """
    return sorted(group, key=lambda cell: (not competes(cell.metadata["labels"]), _mean(cell, metric)))


def _mean(cell: Stored, metric: str) -> float:
    """Return the mean of the metric over the runs, or infinity if any run failed or if no run has a value."""
    values = cell.rows[metric] if metric in cell.rows else cell.rows["seed"] * math.nan
    mean = float(values.where(cell.rows["status"] == "ok", math.inf).mean())
    return math.inf if math.isnan(mean) else mean


def _method(cell: Stored) -> tuple[str, str]:
    return cell.metadata["labels"]["filter"], cell.metadata["labels"]["adaptation"]


def _name(cell: Stored) -> str:
    noise = cell.metadata["labels"]["noise"]
    return " + ".join(_method(cell)) + (f", {noise}" if noise != "default" else "")


def _curves(scenario: str, jobs: Sequence[Stored], palette: Palette) -> list[dict[str, Any]]:
    """Repeat one run of each selected job of a scenario, and return the position errors over time.

    Jobs with user plugins and the best other jobs are selected, up to `MAX_CURVES` jobs. The result has the form that
    the script of the page reads. Without a position reference, the result is empty.

    Raises:
        JerkbenchError: a stored job cannot be run again, for example because its data have changed.
    """
    selected = {job.key for job in sorted(jobs, key=lambda job: not is_of_user(job.metadata["spec"]))[:MAX_CURVES]}
    rows = {job.key: (job, row_of(job, run_programs=True)) for job in jobs if job.key in selected}
    runs = [(job, row, *row.run()) for job, row in rows.values() if row.row["status"] != "failed"]
    recordings = [recording for _, _, recording, _ in runs if recording.reference.enu_m is not None]
    if not recordings:
        return []
    t_s, row = recordings[0].reference.t_s, runs[0][1]
    edges_s = np.linspace(t_s[0], t_s[-1], min(CURVE_STEPS, len(t_s)) + 1)
    lines = []
    for job, _, seen, estimate in runs:
        error_m = position_error_length_m(estimate, seen)
        largest_m = largest_of_steps(seen.reference.t_s[estimate.index], error_m, edges_s)
        name, style = _name(job), palette.style(_method(job))
        lines.append({"key": job.key, "name": name, "colour": style.colour, "dash": style.dash, "error": largest_m})
    draw = f"{'seed' if row.job.seeded else 'phase'} {row.draw}"
    start, step = round(float(edges_s[0]), 6), round(float(edges_s[1] - edges_s[0]), 6)
    outages = np.round(recordings[0].outages_s, 3).tolist()
    return [{"name": scenario, "draw": draw, "start": start, "step": step, "outages": outages, "lines": lines}]


WIDTH = 70
"""Maximum number of characters of a line in a title."""
LINES = 3
"""Maximum number of lines of a title."""
_MAX_NAME_CHARACTERS = 100
"""Maximum number of characters of a file name before its hash. File systems allow 255 bytes with the extension."""


def with_title(recording: Recording, job: Job, draw: int) -> Recording:
    """Return the recording with a longer name for titles, which also contains the disturbance and the seed or phase."""
    title = ", ".join([recording.name] + [job.labels.disturbance] * (job.labels.disturbance != "none"))
    drawn = f", seed {draw}" if job.seeded else f", phase {draw}" if len(job.draws) > 1 else ""
    title = bare(title) if len(title) > LINES * WIDTH else title
    lines = textwrap.wrap(title, WIDTH - len(drawn), max_lines=LINES, placeholder=" ...")
    return replace(recording, name="\n".join(lines) + drawn)


def file_stem(labels: Sequence[str]) -> str:
    """Return a short file name for ``labels``, without the extension. The name depends only on the labels.

    If the labels contain parameters, a hash of the labels replaces the parameters.
    """
    text = "-".join(labels)
    name = re.sub(r"[^A-Za-z0-9.+=-]+", "_", "-".join(bare(label) for label in labels))
    if len(name) <= _MAX_NAME_CHARACTERS and "-".join(map(bare, labels)) == text:
        return name
    return f"{name[:_MAX_NAME_CHARACTERS]}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"


def draw_single(job: Job, folder: Path, *, pdf: bool = False) -> list[Path]:
    """Run the first seed of a job, draw the trajectory and the errors, and return the paths of the figure files.

    If the filter estimates only the attitude, the inclination error is drawn instead of the trajectory.
    """
    recording, estimate = run_seed(job, job.draws[0])
    errors = partial(runs.error_figure, burn_in_s=job.protocol.burn_in_s)
    drawn: dict[str, Callable[..., Figure]] = {"trajectory": runs.trajectory_figure, "errors": errors}
    drawn = {"inclination": runs.inclination_figure} if estimate.attitude_only else drawn
    paths, titled = [], with_title(recording, job, job.draws[0])
    for kind, draw_kind in drawn.items():
        figure = draw_kind(titled, {f"{job.labels.filter} + {job.labels.adaptation}": estimate})
        for ending in ("png", "pdf") if pdf else ("png",):
            paths.append(folder / "figures" / f"{file_stem(job.labels)}-{kind}.{ending}")
            save_figure(figure, paths[-1])
    return paths


FIGURES, REPORT = "figures", "report.html"
PROVENANCE = ("command", "finished", "commit", "versions", "host")
"""Entries of the manifest that the report contains."""


def present(study: Study, workers: int, choice: Choice, *, pdf: bool = False, run_programs: bool = False) -> None:
    """Print messages about the progress, draw the figures of a study, and write its report.

    Args:
        study: study with the rows and the stored jobs.
        workers: number of processes in which figures are drawn.
        choice: value of the option ``figures``, which selects the scenarios whose runs are drawn.
        pdf: whether to write PDF files in addition to PNG files.
        run_programs: whether external programs in stored configurations may run. If ``run_programs`` is False, jobs
            with programs are left out.
    """
    figures, report = study.folder / FIGURES, study.folder / REPORT
    if choice is not Choice.NONE:
        print("Drawing the figures (figures=few, all or none).", flush=True)
    write_report(study, report, Request(choice, out=figures, pdf=pdf, run_programs=run_programs), workers)
    if choice is not Choice.NONE:
        print(f"Figures: {figures}")
    print(f"Report: {report}")


def write_report(
    study: Study,
    path: Path,
    request: Request,
    workers: int,
    method: tuple[str, ...] | None = None,
    rule: VerdictRule = RULE,
) -> None:
    """Draw the figures of a study and write its report as one HTML file.

    Args:
        study: study with the rows and the stored jobs.
        path: path of the HTML file to write.
        request: the requested figures.
        workers: number of processes in which figures are drawn.
        method: factors that define a method, or None for the default of `study_verdicts`.
        rule: margin and level of the verdicts.
    """
    pictures, stretches = draw_study(study, request, workers)
    manifest = read_manifest(study.folder)
    about = {key: {**study.metadata[key], "labels": labels} for key, labels in study.labels.items()}
    name, provenance = study.folder.resolve().name, {key: manifest[key] for key in PROVENANCE if key in manifest}
    given = name, study.rows, about, study.notes, provenance, pictures, stretches
    write_text(path, page(*given, rule=rule, method=method))
