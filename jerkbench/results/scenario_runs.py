"""The runs of a study that its figures and its report show: of each scenario some methods, made once more."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from jerkbench import plugins
from jerkbench.attitude.tilt import Tilt
from jerkbench.errors import JerkbenchError
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import position_error_length_m
from jerkbench.jobs.inputs import shared_inputs
from jerkbench.recording import Recording
from jerkbench.report.analysis.columns import SCENARIO_FACTORS, competes
from jerkbench.report.drawings import Scene
from jerkbench.report.page.script_data import Stretch, largest_of_steps
from jerkbench.results.content import Stored
from jerkbench.results.replay import StoredRow, row_of, runnable
from jerkbench.results.run_figures import file_stem, with_title
from jerkbench.results.store import Store
from jerkbench.results.study import Study

WANTED = (("baseline", "none"), ("jerk", "mtf"), ("jerk", "none"), ("gnss_only", "none"))
"""Filters and adaptations that are drawn where they are there, beside the best one."""

SHOWN_METHODS = 5
"""Methods in one picture, unless more are the user's own, or wanted by name."""

SceneCells = Mapping[str, Mapping[str, str]]
"""Key and labels of each cell."""

TILTS = ("none", "scalar", "mtf")
"""Ways of the tilt filter to adapt that are compared; lee needs a memory of its own."""

FROM_ELSEWHERE = ("command", "trajectory")
"""Filters of this package that are a method of the user's."""

SEEDS = 10
"""Runs of the best method whose NEES and NIS are averaged."""

MOST_CELLS = 40
"""Cells of a scenario whose errors are kept, the user's own and the best ones."""

KEPT_ERRORS = 120_000
"""Errors of all cells together: two bytes each, so that the file stays small."""

STRETCH_STEPS = (100, 600)
"""Fewest and most steps of a recording."""


def scene_cells(study: Study) -> dict[str, SceneCells]:
    """Return the names of the scenarios of a study, in their order, each with its cells."""
    scenarios: dict[str, dict[str, Mapping[str, str]]] = {}
    for key, labels in study.labels.items():
        scenarios.setdefault(", ".join(labels[factor] for factor in SCENARIO_FACTORS), {})[key] = labels
    return dict(scenarios)


def read_cells(folder: Path, cells: SceneCells, *, run_programs: bool) -> list[Stored]:
    """Return the cells that may run again, with their labels."""
    stored, _ = Store(folder).read(list(cells))
    allowed = runnable(stored, run_programs=run_programs)
    return [replace(cell, metadata={**cell.metadata, "labels": cells[cell.key]}) for cell in allowed]


def load_scene(
    folder: Path,
    name: str,
    cells: SceneCells,
    metric: str,
    methods: Sequence[tuple[str, str]] = (),
    seed: int | None = None,
    *,
    run_programs: bool = False,
) -> Scene:
    """Run those cells of a scenario again that are worth a picture.

    Args:
        folder: the study's.
        name: of the scenario.
        cells: those of the scenario.
        metric: by which they are chosen.
        methods: filters and adaptations that are shown beside the best and the user's own; none: `WANTED`, and the
            next best.
        seed: the run that is shown; None: the first.
        run_programs: whether programs of stored cells may run; without it their cells are left out.

    Raises:
        JerkbenchError: they cannot be run again.
    """
    allowed = read_cells(folder, cells, run_programs=run_programs)
    if not allowed:
        raise JerkbenchError("each of its methods is a stored program, which runs only with --run-programs.")
    return _scene(name, _chosen(allowed, metric, methods), seed, run_programs=run_programs)


def _scene(name: str, chosen: Mapping[str, Stored], seed: int | None, *, run_programs: bool) -> Scene:
    rows = {method: row_of(stored, seed, run_programs=run_programs) for method, stored in chosen.items()}
    runs = {method: row.run() for method, row in rows.items()}
    best, row = next(iter(rows.items()))
    recording, estimate = runs[best]
    return Scene(
        name,
        stem=file_stem([name]),
        recording=with_title(recording, row.job, row.draw),
        attitude=shared_inputs().attitude(recording, row.job.scenario.attitude),
        estimates={method: estimate for method, (_, estimate) in runs.items()},
        tilts=_tilts(row, estimate),
        best=best,
        best_runs=tuple(_best_runs(chosen[best], run_programs=run_programs)),
        burn_in_s=row.job.scoring.burn_in_s,
    )


def _tilts(row: StoredRow, own: Estimate) -> dict[str, Estimate]:
    scenario, attitude = row.job.scenario, row.job.scenario.attitude
    if not isinstance(attitude, Tilt):
        return {row.job.labels.attitude: own}
    varied = {adapt: replace(scenario, attitude=replace(attitude, adapt=adapt)) for adapt in TILTS}
    jobs = {adapt: replace(row.job, scenario=own) for adapt, own in varied.items()}
    return {f"tilt + {adapt}": replace(row, job=job).run()[1] for adapt, job in jobs.items()}


def _best_runs(stored: Stored, *, run_programs: bool) -> Iterator[tuple[Recording, Estimate]]:
    good = stored.rows[(stored.rows["status"] == "ok") & (stored.rows["replicate"] == "seed")]
    seeds: list[int | None] = [int(seed) for seed in list(good["seed"])[:SEEDS]]
    return (row_of(stored, seed, run_programs=run_programs).run() for seed in seeds or [None])


def _chosen(group: list[Stored], metric: str, wanted: Sequence[tuple[str, str]]) -> dict[str, Stored]:
    """Pick the best, of each plugin of the user's the best, those that are wanted, and then the next best.

    Of one method with several noises it is the best.
    """
    methods: dict[tuple[str, str], Stored] = {}
    own: dict[tuple[str, str], tuple[str, str]] = {}
    for cell in ranked(group, metric):
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


def steps_of(scenarios: Iterable[SceneCells]) -> int:
    """Return into how many steps the recordings are cut, so that the errors of all cells fit.

    Args:
        scenarios: the cells of each.
    """
    lines = sum(min(len(cells), MOST_CELLS) for cells in scenarios)
    return int(np.clip(KEPT_ERRORS // max(1, lines), *STRETCH_STEPS))


def load_stretch(
    folder: Path, scenario: str, cells: SceneCells, metric: str, steps: int, *, run_programs: bool = False
) -> Stretch | None:
    """Run one run of each of the best and of the user's own cells again; None where the position is not known.

    Args:
        folder: the study's.
        scenario: its name.
        cells: those of the scenario.
        metric: by which they are chosen.
        steps: into how many the recording is cut.
        run_programs: whether programs of stored cells may run; without it their cells are left out.

    Raises:
        JerkbenchError: they cannot be run again.
    """
    best = ranked(read_cells(folder, cells, run_programs=run_programs), metric)
    kept = [cell.key for cell in sorted(best, key=lambda cell: not of_user(cell.metadata["spec"]))[:MOST_CELLS]]
    rows = {cell.key: row_of(cell, run_programs=run_programs) for cell in best if cell.key in kept}
    runs = {key: row.run() for key, row in rows.items() if row.row["status"] != "failed"}
    recordings = [recording for recording, _ in runs.values() if recording.reference.enu_m is not None]
    if not recordings:
        return None
    return _stretch(scenario, next(iter(rows.values())), recordings[0], runs, steps)


def _stretch(
    scenario: str, first: StoredRow, recording: Recording, runs: dict[str, tuple[Recording, Estimate]], steps: int
) -> Stretch:
    t_s = recording.reference.t_s
    edges_s = np.linspace(t_s[0], t_s[-1], min(steps, len(t_s)) + 1)
    errors_m = {
        key: largest_of_steps(seen.reference.t_s[estimate.index], position_error_length_m(estimate, seen), edges_s)
        for key, (seen, estimate) in runs.items()
    }
    draw = f"{'seed' if first.job.scenario.seeded else 'phase'} {first.draw}"
    return Stretch(scenario, draw, float(edges_s[0]), float(edges_s[1] - edges_s[0]), recording.outages_s, errors_m)
