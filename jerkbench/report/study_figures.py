"""The figures of a study, drawn in processes side by side: some runs of each scenario once more; and its report."""

import hashlib
import re
import sys
import textwrap
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jerkbench import plugins
from jerkbench.attitude.tilt import Tilt
from jerkbench.errors import JerkbenchError
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_rows import position_error_length_m
from jerkbench.files import write_atomically, write_text
from jerkbench.jobs.executors import Workers
from jerkbench.jobs.inputs import shared_inputs
from jerkbench.jobs.job import Job
from jerkbench.jobs.manifest import read_manifest
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.replay import StoredRow, row_of, runnable
from jerkbench.jobs.rows import run_seed
from jerkbench.jobs.run import outcomes
from jerkbench.jobs.store import Store, Stored
from jerkbench.jobs.study import Study, named_part
from jerkbench.recording import Recording
from jerkbench.report import Choice
from jerkbench.report.columns import METHOD, SCENARIO_FACTORS, competes
from jerkbench.report.comparisons import RULE, VerdictRule
from jerkbench.report.drawings import (
    Drawing,
    Methods,
    Picture,
    Scene,
    by_difference,
    of_rows,
    of_scene,
    palette_of,
    telling_scenes,
)
from jerkbench.report.labels import bare
from jerkbench.report.page_content import Stretch, largest_of_steps
from jerkbench.report.plots.style import Palette
from jerkbench.report.summary import main_metric

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

LIMIT = 20
"""Scenarios whose runs are drawn at most, unless asked otherwise."""

WANTED = (("baseline", "none"), ("jerk", "mtf"), ("jerk", "none"), ("gnss_only", "none"))
"""Filters and adaptations that are drawn where they are there, beside the best one."""

SHOWN_METHODS = 5
"""Methods in one picture, unless more are the user's own, or wanted by name."""

TILTS = ("none", "scalar", "mtf")
"""Ways of the tilt filter to adapt that are compared; lee needs a memory of its own."""

FROM_ELSEWHERE = ("command", "trajectory")
"""Filters of this package that are a method of the user's."""

SEEDS = 10
"""Runs of the best method whose NEES and NIS are averaged."""

MAX_CURVES = 40
"""Jobs of a scenario whose errors over time are shown: the user's own and the best ones."""

MAX_ERRORS = 120_000
"""Errors of all jobs together. Each takes two bytes of the report."""

STRETCH_STEPS = (100, 600)
"""Fewest and most steps of a recording."""


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


DrawnStudy = tuple[list[Picture], list[Stretch]]
"""Figures, and the errors over time of scenarios."""
DrawingTask = Callable[[], DrawnStudy]


def draw_study(study: Study, request: Request, workers: int) -> DrawnStudy:
    """Draw the figures of a study: those of all its rows, then those of its scenarios' runs.

    A scenario that cannot be run again is reported on standard error.

    Args:
        study: the study.
        request: which of them.
        workers: number of processes.

    Raises:
        JerkbenchError: the study has no such method, scenario or seed.
    """
    if request.choice is Choice.NONE:
        return [], []
    numbered = list(enumerate(_drawing_tasks(study, request)))
    done: dict[int, DrawnStudy] = {}
    with Progress(len(numbered), doing="Figures", unit="sets of figures") as progress, Workers(count=workers) as pool:
        # The figures of all rows take less time than those of a scenario, so they are drawn last.
        chunks = [[task] for task in (*numbered[1:], numbered[0])]
        for ((place, _),), drawn in outcomes(_draw_first, chunks, pool.pool(len(chunks))):
            if isinstance(drawn, Exception):
                raise drawn
            done[place] = drawn
            progress.advance()
    pictures, stretches = zip(*(done[place] for place, _ in numbered), strict=True)
    return list(chain(*pictures)), list(chain(*stretches))


def _draw_first(tasks: Sequence[tuple[int, DrawingTask]]) -> tuple[int, DrawnStudy]:
    _, draw = tasks[0]
    return 1, draw()


def _drawing_tasks(study: Study, request: Request) -> list[DrawingTask]:
    """Return a task for all rows, and one for each scenario, in the order in which they are shown."""
    metric, palette = main_metric(study.rows), palette_of(study.rows)
    of_all_rows = partial(_draw_rows, request, study.rows, palette)
    study = _requested(study, request)
    scenarios: dict[str, dict[str, Mapping[str, str]]] = {}
    for key, labels in study.labels.items():
        scenarios.setdefault(", ".join(labels[factor] for factor in SCENARIO_FACTORS), {})[key] = labels
    named = tuple(dict.fromkeys(zip(study.rows["filter"], study.rows["adaptation"], strict=True)))
    methods: Mapping[str, Methods] = dict.fromkeys(scenarios, named if request.methods else ())
    few = request.choice is Choice.FEW and not (request.methods or request.scenarios)
    if few or (len(scenarios) > request.limit and not request.scenarios):
        ranked = dict(list(by_difference(study.rows, metric, list(scenarios)).items())[: request.limit])
        scenarios = {name: labels for name, labels in scenarios.items() if name in ranked}
        methods = telling_scenes(ranked) if few else methods
    steps = _steps_of(scenarios.values()) if request.traces else 0
    return [
        of_all_rows,
        *(
            partial(_draw_scenario, request, study.folder, name, labels, metric, palette, methods.get(name), steps)
            for name, labels in scenarios.items()
            if steps or name in methods
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


def _draw_rows(request: Request, rows: "pd.DataFrame", palette: Palette) -> DrawnStudy:
    return [_picture(drawing, "", request) for drawing in of_rows(rows, palette)], []


def _draw_scenario(
    request: Request,
    folder: Path,
    name: str,
    labels: Mapping[str, Mapping[str, str]],
    metric: str,
    palette: Palette,
    methods: Methods | None,
    steps: int,
) -> DrawnStudy:
    """Draw the figures of a scenario.

    Args:
        request: which figures.
        folder: of the study.
        name: of the scenario.
        labels: of its jobs, by key.
        metric: the leading one.
        palette: of the study.
        methods: that the figures show; empty: the best ones; None: no figures are drawn.
        steps: number of steps of each error over time; 0: none is needed.
    """
    try:
        stored = runnable(Store(folder).read(list(labels))[0], run_programs=request.run_programs)
        jobs = ranked([replace(job, metadata={**job.metadata, "labels": labels[job.key]}) for job in stored], metric)
        drawings = [] if methods is None else of_scene(_scene(name, jobs, methods, request.seed), palette)
        pictures = [_picture(drawing, name, request) for drawing in drawings]
        return pictures, list(_stretches(name, jobs, steps)) if steps else []
    except JerkbenchError as error:
        print(f"jerkbench: no figures of {name}: {error}", file=sys.stderr)
        return [], []


def _picture(drawing: Drawing, scenario: str, request: Request) -> Picture:
    """Render a figure once for the page and the file, and once more as PDF if that is requested."""
    from jerkbench.report.plots.style import png_bytes, save_pdf

    png = png_bytes(drawing.figure)
    out = request.out
    if out is not None:
        write_atomically(out / f"{drawing.name}.png", lambda path: path.write_bytes(png))
        if request.pdf:
            save_pdf(drawing.figure, out / f"{drawing.name}.pdf")
    return Picture(drawing.name, drawing.caption, scenario, png)


def _scene(name: str, jobs: Sequence[Stored], wanted: Methods, seed: int | None) -> Scene:
    """Run the chosen ones of ``jobs``, the best first, again.

    Raises:
        JerkbenchError: they cannot be run again.
    """
    if not jobs:
        raise JerkbenchError("each of its methods is a stored program, which runs only with --run-programs.")
    chosen = _chosen(jobs, wanted)
    rows = {method: row_of(job, seed, run_programs=True) for method, job in chosen.items()}
    runs = {method: row.run() for method, row in rows.items()}
    best, row = next(iter(rows.items()))
    recording, estimate = runs[best]
    stored = chosen[best].rows
    seeds = stored["seed"][(stored["status"] == "ok") & (stored["replicate"] == "seed")].tolist()[:SEEDS]
    return Scene(
        name,
        stem=file_stem([name]),
        recording=with_title(recording, row.job, row.draw),
        attitude=shared_inputs().attitude(recording, row.job.scenario.attitude),
        estimates={method: estimate for method, (_, estimate) in runs.items()},
        tilts=_tilts(row, estimate),
        best=best,
        best_runs=tuple(row_of(chosen[best], own, run_programs=True).run() for own in seeds or [None]),
        burn_in_s=row.job.evaluation.burn_in_s,
    )


def _tilts(row: StoredRow, own: Estimate) -> dict[str, Estimate]:
    scenario, attitude = row.job.scenario, row.job.scenario.attitude
    if not isinstance(attitude, Tilt):
        return {row.job.labels.attitude: own}
    varied = {adapt: replace(scenario, attitude=replace(attitude, adapt=adapt)) for adapt in TILTS}
    return {
        f"tilt + {adapt}": replace(row, job=replace(row.job, scenario=own)).run()[1] for adapt, own in varied.items()
    }


def _chosen(cells: Sequence[Stored], wanted: Methods) -> dict[str, Stored]:
    """Pick the best, of each plugin of the user's the best, those that are wanted, and then the next best.

    Of one method with several noises it is the best.

    Args:
        cells: the best first.
        wanted: filters and adaptations; none: `WANTED`, and the next best.
    """
    methods: dict[tuple[str, str], Stored] = {}
    own: dict[tuple[str, str], tuple[str, str]] = {}
    for cell in cells:
        method = cell.metadata["labels"]["filter"], cell.metadata["labels"]["adaptation"]
        methods.setdefault(method, cell)
        for plugin in of_user(cell.metadata["spec"]):
            own.setdefault(plugin, method)
    best, *others = methods
    known = [method for method in wanted or WANTED if method in methods]
    most = len(methods) if wanted else max(SHOWN_METHODS, 1 + len(own))
    places = list(dict.fromkeys([best, *own.values(), *known, *([] if wanted else others)]))
    return {_name(methods[key]): methods[key] for key in places[:most]}


def of_user(spec: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return kind and name of filter and adaptation of a stored cell, where they are the user's own.

    That is a plugin from elsewhere, a program, or a trajectory that something else estimated.
    """
    parts = [(kind, str(spec[kind]["name"])) for kind in ("filter", "adaptation")]
    known = [(kind, name) for kind, name in parts if name in plugins.names(kind)]
    return [part for part in known if part[1] in FROM_ELSEWHERE or not plugins.is_own(plugins.get(*part))]


def ranked(group: Sequence[Stored], metric: str) -> list[Stored]:
    """Return cells of a scenario, the best first, and those that do not compete last."""
    return sorted(group, key=lambda cell: (not competes(cell.metadata["labels"]), _mean(cell, metric)))


def _mean(cell: Stored, metric: str) -> float:
    """The mean of the metric; of a method that lost a run, or has no value, infinite."""
    if metric not in cell.rows or not (cell.rows["status"] == "ok").all():
        return float("inf")
    mean = float(cell.rows[metric].mean())
    return mean if mean == mean else float("inf")  # noqa: PLR0124 - NaN


def _name(cell: Stored) -> str:
    labels = cell.metadata["labels"]
    noise = "" if labels["noise"] == "default" else f", {labels['noise']}"
    return f"{labels['filter']} + {labels['adaptation']}{noise}"


def _steps_of(scenarios: Iterable[Collection[str]]) -> int:
    """Return the number of steps of each error over time, so that the errors of all jobs fit."""
    curves = sum(min(len(keys), MAX_CURVES) for keys in scenarios)
    return int(np.clip(MAX_ERRORS // max(1, curves), *STRETCH_STEPS))


def _stretches(scenario: str, jobs: Sequence[Stored], steps: int) -> Iterator[Stretch]:
    """Run one run of the user's own and of the best jobs again. Yields nothing if there is no position reference.

    Raises:
        JerkbenchError: they cannot be run again.
    """
    chosen = {job.key for job in sorted(jobs, key=lambda job: not of_user(job.metadata["spec"]))[:MAX_CURVES]}
    rows = {job.key: row_of(job, run_programs=True) for job in jobs if job.key in chosen}
    runs = {key: row.run() for key, row in rows.items() if row.row["status"] != "failed"}
    recordings = [recording for recording, _ in runs.values() if recording.reference.enu_m is not None]
    if not recordings:
        return
    t_s, first = recordings[0].reference.t_s, next(iter(rows.values()))
    edges_s = np.linspace(t_s[0], t_s[-1], min(steps, len(t_s)) + 1)
    errors_m = {
        key: largest_of_steps(seen.reference.t_s[estimate.index], position_error_length_m(estimate, seen), edges_s)
        for key, (seen, estimate) in runs.items()
    }
    draw = f"{'seed' if first.job.scenario.seeded else 'phase'} {first.draw}"
    step_s = float(edges_s[1] - edges_s[0])
    yield Stretch(scenario, draw, float(edges_s[0]), step_s, recordings[0].outages_s, errors_m)


WIDTH = 70
"""Letters of a line: as many as a figure has room for."""
LINES = 3
"""Lines of a title: the figure below it needs its room."""
_MAX_NAME_CHARACTERS = 100
"""Letters of a file's name before its hash; a file system takes 255 bytes, endings included."""


def with_title(recording: Recording, job: Job, draw: int) -> Recording:
    """Return the recording with a name that says its disturbance too (if any), and its seed or phase."""
    disturbance = job.labels.disturbance
    disturbed = () if disturbance == "none" else (disturbance,)
    drawn = (f"seed {draw}",) if job.scenario.seeded else (f"phase {draw}",) if len(job.draws) > 1 else ()
    return replace(recording, name=_fitted((recording.name, *disturbed), drawn))


def file_stem(labels: Sequence[str]) -> str:
    """Return a file's name for ``labels``, without its ending: short, and the same for the same labels.

    Parameters are left out of it; a hash of all that the labels say stands for them.
    """
    text = "-".join(labels)
    name = re.sub(r"[^A-Za-z0-9.+=-]+", "_", "-".join(bare(label) for label in labels))
    if len(name) <= _MAX_NAME_CHARACTERS and "-".join(map(bare, labels)) == text:
        return name
    return f"{name[:_MAX_NAME_CHARACTERS]}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"


def _fitted(named: Sequence[str], drawn: Sequence[str]) -> str:
    """All of it in lines; where these are too many, without the parameters, and then cut."""
    for words in (named, [bare(word) for word in named]):
        lines = textwrap.wrap(", ".join((*words, *drawn)), WIDTH)
        if len(lines) <= LINES:
            return "\n".join(lines)
    tail = ", ".join(("...", *drawn))
    return "\n".join(textwrap.wrap(", ".join(words)[: LINES * WIDTH // 2] + tail, WIDTH))


def draw_single(job: Job, folder: Path, *, pdf: bool = False) -> list[Path]:
    """Draw trajectory and errors of the first seed; returns the files."""
    from jerkbench.report.plots.runs import error_figure, inclination_figure, trajectory_figure
    from jerkbench.report.plots.style import save_figure

    recording, estimate = run_seed(job, job.draws[0])
    errors = partial(error_figure, burn_in_s=job.evaluation.burn_in_s)
    drawn: dict[str, Callable[..., Figure]] = {"trajectory": trajectory_figure, "errors": errors}
    if estimate.attitude_only:
        drawn = {"inclination": inclination_figure}
    paths = []
    titled = with_title(recording, job, job.draws[0])
    for kind, draw_kind in drawn.items():
        figure = draw_kind(titled, {f"{job.labels.filter} + {job.labels.adaptation}": estimate})
        for ending in ("png", "pdf") if pdf else ("png",):
            paths.append(folder / "figures" / f"{file_stem(job.labels)}-{kind}.{ending}")
            save_figure(figure, paths[-1])
    return paths


FIGURES, REPORT = "figures", "report.html"
PROVENANCE = ("command", "finished", "commit", "versions", "host")
"""Entries of the manifest that the report shows."""

OTHERWISE = {
    Choice.FEW: "figures=all draws those of every scenario, figures=none leaves them out",
    Choice.ALL: "figures=few draws those that carry a finding, figures=none leaves them out",
}
"""What one can ask for instead."""


def present(study: Study, workers: int, choice: Choice, *, pdf: bool = False, run_programs: bool = False) -> None:
    """Draw the figures of a study and write its report; say so before, because it takes a while.

    Args:
        study: the study.
        workers: number of processes.
        choice: which figures.
        pdf: whether each is a PDF, too.
        run_programs: whether programs of stored cells may run; without it they are left out.
    """
    figures, report = study.folder / FIGURES, study.folder / REPORT
    if choice is not Choice.NONE:
        print(f"Drawing the figures ({OTHERWISE[choice]}).", flush=True)
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
        study: the study.
        path: of the file.
        request: which figures.
        workers: number of processes that draw.
        method: factors that a method is made of; None: those by default.
        rule: by which methods are judged.
    """
    from jerkbench.report.page import Results, page

    pictures, stretches = draw_study(study, request, workers)
    manifest, labels = read_manifest(study.folder), study.labels
    configured = manifest.get("notes", {})
    notes = {key: dict.fromkeys([*configured.get(key, []), *own["notes"]]) for key, own in study.metadata.items()}
    about = {
        key: {**own, "labels": labels[key], "notes": list(notes[key])}
        for key, own in study.metadata.items()
        if key in labels
    }
    results = Results(
        name=study.folder.resolve().name,
        rows=study.rows,
        keys=list(study.keys),
        about=about,
        notes=study.notes,
        provenance={key: manifest[key] for key in PROVENANCE if key in manifest},
        rule=rule,
        method=method,
    )
    write_text(path, page(results, pictures, stretches))
