"""The runs of a study that its figures show: of each scenario a few methods, over the same seed."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from jerkbench import plugins
from jerkbench.attitude.tilt import Tilt
from jerkbench.errors import JerkbenchError
from jerkbench.estimate import Attitude, Estimate
from jerkbench.execution.inputs import shared_inputs
from jerkbench.recording import Recording
from jerkbench.report.analysis.references import competes
from jerkbench.results.content import Stored
from jerkbench.results.replay import StoredRow, row_of, runnable
from jerkbench.results.store import Store
from jerkbench.results.study import Study
from jerkbench.results.titles import with_title

SCENARIO = ("dataset", "disturbance", "attitude")
"""Factors whose labels are a scenario's name."""

WANTED = (("baseline", "none"), ("jerk", "mtf"), ("jerk", "none"), ("gnss_only", "none"))
"""Filters and adaptations that are drawn where they are there, beside the best one."""

SHOWN = 5
"""Methods in one picture, unless more are the user's own, or wanted by name."""

Cells = Mapping[str, Mapping[str, str]]
"""Key and labels of each cell."""

TILTS = ("none", "scalar", "mtf")
"""Ways of the tilt filter to adapt that are compared; lee needs a memory of its own."""

FROM_ELSEWHERE = ("command", "trajectory")
"""Filters of this package that are a method of the user's."""

SEEDS = 10
"""Runs of the best method whose NEES and NIS are averaged."""


@dataclass(frozen=True, eq=False)
class Scene:
    """One scenario, its first seed.

    Attributes:
        name: data set, disturbance, attitude.
        recording: what the filters saw; its name is the figures' title.
        attitude: what they were given.
        estimates: of each method, by its name.
        tilts: the best method with each way of the tilt filter to adapt; if its attitude is no `tilt`, its own alone.
        best: the method with the lowest mean, of those that compete.
        best_runs: recordings and estimates of its first seeds.
        burn_in_s: errors count from then on.
    """

    name: str
    recording: Recording
    attitude: Attitude
    estimates: Mapping[str, Estimate]
    tilts: Mapping[str, Estimate]
    best: str
    best_runs: tuple[tuple[Recording, Estimate], ...]
    burn_in_s: float


def scene_cells(study: Study) -> dict[str, Cells]:
    """Return the names of the scenarios of a study, in their order, each with its cells."""
    scenarios: dict[str, dict[str, Mapping[str, str]]] = {}
    for key, labels in study.labels.items():
        scenarios.setdefault(", ".join(labels[factor] for factor in SCENARIO), {})[key] = labels
    return dict(scenarios)


def read_cells(folder: Path, cells: Cells, *, run_programs: bool) -> list[Stored]:
    """Return the cells that may run again, with their labels."""
    stored, _ = Store(folder).read(list(cells))
    allowed = runnable(stored, run_programs=run_programs)
    return [replace(cell, metadata={**cell.metadata, "labels": cells[cell.key]}) for cell in allowed]


def load_scene(
    folder: Path,
    name: str,
    cells: Cells,
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
    best = next(iter(rows))
    recording = runs[best][0]
    attitude = shared_inputs().attitude(recording, rows[best].cell.attitude)
    estimates = {method: estimate for method, (_, estimate) in runs.items()}
    runs_of_best = tuple(_best_runs(chosen[best], run_programs=run_programs))
    burn_in_s = rows[best].cell.protocol.burn_in_s
    named = with_title(recording, rows[best].cell, rows[best].draw)
    return Scene(name, named, attitude, estimates, _tilts(rows[best], estimates[best]), best, runs_of_best, burn_in_s)


def _tilts(row: StoredRow, own: Estimate) -> dict[str, Estimate]:
    attitude = row.cell.attitude
    if not isinstance(attitude, Tilt):
        return {row.cell.labels.attitude: own}
    varied = {adapt: replace(row.cell, attitude=replace(attitude, adapt=adapt)) for adapt in TILTS}
    return {f"tilt + {adapt}": replace(row, cell=cell).run()[1] for adapt, cell in varied.items()}


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
    most = len(methods) if wanted else max(SHOWN, 1 + len(own))
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
    noise = "" if labels["noise"] == "own" else f", {labels['noise']}"
    return f"{labels['filter']} + {labels['adaptation']}{noise}"
