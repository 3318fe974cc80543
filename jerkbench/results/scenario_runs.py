"""The runs of a study that its figures show: of each scenario a few methods, over the same seed."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

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

WANTED = (("baseline", "none"), ("jerk", "mtf"), ("jerk", "none"), ("gnss_only", "none"))
"""Filters and adaptations that are drawn where they are there, beside the best one."""

SHOWN = 5
"""Methods in one picture."""

TILTS = ("none", "scalar", "mtf")
"""Ways of the tilt filter to adapt that are compared; lee needs a memory of its own."""

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


def scene_keys(study: Study) -> dict[str, tuple[str, ...]]:
    """Return the names of the scenarios of a study, in their order, each with the keys of its cells."""
    named = study.rows[["dataset", "disturbance", "attitude"]].astype(str).agg(", ".join, axis=1)
    scenarios: dict[str, dict[str, None]] = {}
    for name, key in zip(named, study.keys, strict=True):
        scenarios.setdefault(name, {})[key] = None
    return {name: tuple(keys) for name, keys in scenarios.items()}


def load_scene(
    folder: Path,
    name: str,
    keys: Sequence[str],
    metric: str,
    methods: Sequence[tuple[str, str]] = (),
    *,
    run_programs: bool = False,
) -> Scene:
    """Run those cells ``keys`` of a scenario again that are worth a picture.

    Args:
        folder: the study's.
        name: of the scenario.
        keys: of its cells.
        metric: by which they are chosen.
        methods: filters and adaptations that are shown beside the best; none: `WANTED`, and the next best.
        run_programs: whether programs of stored cells may run; without it their cells are left out.

    Raises:
        JerkbenchError: they cannot be run again.
    """
    stored, _ = Store(folder).read(keys)
    allowed = runnable(stored, run_programs=run_programs)
    if stored and not allowed:
        raise JerkbenchError("each of its methods is a stored program, which runs only with --run-programs.")
    return _scene(name, _chosen(allowed, metric, methods), run_programs=run_programs)


def _scene(name: str, chosen: Mapping[str, Stored], *, run_programs: bool) -> Scene:
    rows = {method: row_of(stored, run_programs=run_programs) for method, stored in chosen.items()}
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
    """Pick the best, those that are wanted, and then the next best; of one method with several noises the best."""
    methods: dict[tuple[str, str], Stored] = {}
    for cell in ranked(group, metric):
        methods.setdefault((cell.metadata["labels"]["filter"], cell.metadata["labels"]["adaptation"]), cell)
    ordered = list(methods)
    places = [ordered[0], *(method for method in wanted or WANTED if method in methods), *([] if wanted else ordered)]
    return {_name(methods[key]): methods[key] for key in list(dict.fromkeys(places))[:SHOWN]}


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
