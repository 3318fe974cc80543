"""The sentences below a study's tables: notes on its cells, their code, and remarks about what is left out."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from jerkbench import plugins
from jerkbench.jobs.labels import contradiction
from jerkbench.parameters import provenance_of
from jerkbench.plain import plain
from jerkbench.report.analysis.columns import FACTORS, FLOOR, SCENARIO_FACTORS, WHY
from jerkbench.results.conditions import Current

if TYPE_CHECKING:
    import pandas as pd

ERROR_COLUMN = "position_rmse_m"

WORSE_RATIO = 1.1
"""A method whose median error is so many times that of the fixes alone is told."""

MOST_TOLD = 3
"""Scenarios, methods of each, and wrong labels, that are told."""

CellMetadata = Mapping[str, Any]
"""What is known of a cell."""


def study_notes(keys: Sequence[str], cells: Sequence[CellMetadata], manifest: dict[str, Any]) -> list[str]:
    """Return the notes of the configuration, and then of the recordings, about the cells that are shown."""
    configured = [note for key in keys for note in manifest.get("notes", {}).get(key, [])]
    return list(dict.fromkeys([*configured, *(note for cell in cells for note in cell["notes"])]))


def code_of(cells: Sequence[CellMetadata]) -> str:
    """The commit, or how many there are; without one the beginning of the code's hash."""
    named = {cell["commit"] or f"code {cell['code'][:12]}" for cell in cells}
    return f"{len(named)} versions of the code" if len(named) > 1 else f"commit {named.pop()}"


def remarks_on(cells: Sequence[CellMetadata], chosen: Current, broken: list[str]) -> list[str]:
    """Return remarks about the cells that are shown, and about those that are left out."""
    remarks = []
    codes = {(cell["code"], tuple(sorted(cell["versions"].items()))) for cell in cells}
    if len(codes) > 1:
        remarks.append(f"These results come from {len(codes)} versions of the code or its libraries.")
    if len(kinds := {kind for cell in cells if (kind := cell.get("processor"))}) > 1:
        named = ", ".join(sorted({kind.partition(":")[0] for kind in kinds}))
        remarks.append(f"These results come from {len(kinds)} kinds of processors ({named}): last bits may differ.")
    if others := chosen.outdated:
        which = "1 result of the same name" if others == 1 else f"{others} results of the same names"
        remarks.append(f"{which} with other settings, code or data {'is' if others == 1 else 'are'} left out.")
    if others := chosen.others:
        which = "1 stored run is" if others == 1 else f"{others} stored runs are"
        remarks.append(f"{which} left out: the last command asked for other seeds.")
    if wrong := list(dict.fromkeys(filter(None, (contradiction(cell["labels"], cell["spec"]) for cell in cells)))):
        told = "; ".join(map(plain, wrong[:MOST_TOLD]))
        remarks.append(f"Labels name another plugin than ran: {told}.")
    if broken:
        remarks.append(f"{damaged(broken)} left out: {', '.join(map(plain, broken))}.")
    return remarks


def not_as_published(cells: Sequence[CellMetadata]) -> list[str]:
    """Return which of the methods are simplified or nobody's but ours; what competes with nobody is left out."""
    told: dict[str, list[str]] = {"simplified": [], "own": []}
    for kind, name in sorted({(kind, str(cell["spec"][kind]["name"])) for cell in cells for kind in WHY}):
        known = provenance_of(plugins.get(kind, name)) if name in plugins.names(kind) else None
        if known and known.kind in told and name not in WHY[kind]:
            told[known.kind].append(name)
    named = "; ".join(f"{kind}: {', '.join(names)}" for kind, names in told.items() if names)
    return [f"Not as published: {named}. `jerkbench show` says what differs."] if named else []


def worse_than_fixes(rows: "pd.DataFrame", cells: Sequence[CellMetadata]) -> list[str]:
    """Return which methods lose to the fixes carried on without an IMU, the likely causes, and what to try.

    Args:
        rows: of the study.
        cells: the metadata of each cell.
    """
    if ERROR_COLUMN not in rows.columns or not (rows["filter"] == FLOOR).any():
        return []
    run = rows[rows["status"] != "failed"]
    errors = run[ERROR_COLUMN].where(run["status"] == "ok", float("inf"))
    medians = errors.groupby([run[key].astype(str) for key in FACTORS]).median()
    scenarios: dict[tuple[str, ...], dict[tuple[str, ...], float]] = {}
    for labels, median in zip(medians.index.tolist(), medians.tolist(), strict=True):
        scenarios.setdefault(labels[: len(SCENARIO_FACTORS)], {})[labels[len(SCENARIO_FACTORS) :]] = median
    losing = {}
    for scenario, methods in scenarios.items():
        floor = min((error for method, error in methods.items() if method[0] == FLOOR), default=float("nan"))
        if worse := {method: error for method, error in methods.items() if error > WORSE_RATIO * floor}:
            losing[scenario] = _losers(scenario, worse, floor)
    if not losing:
        return []
    more = [f"Methods lose to {FLOOR} in {len(losing) - MOST_TOLD} more scenarios."] if len(losing) > MOST_TOLD else []
    return [*list(losing.values())[:MOST_TOLD], *_advice(cells, {scenario[-1] for scenario in losing}), *more]


def _losers(scenario: tuple[str, ...], worse: Mapping[tuple[str, ...], float], floor: float) -> str:
    ranked = sorted(worse.items(), key=lambda pair: -pair[1])
    named = [
        f"{'+'.join(m for m in method if m not in ('none', 'default'))} ({_shown(error)})" for method, error in ranked
    ]
    more = f" and {len(named) - MOST_TOLD} more" if len(named) > MOST_TOLD else ""
    where, worst = ", ".join(scenario), ", ".join(named[:MOST_TOLD])
    return f"Worse than {FLOOR} ({floor:.3g} m), which has no IMU, in {where}: {worst}{more}."


def _shown(error_m: float) -> str:
    return f"{error_m:.3g} m" if error_m < float("inf") else "lost"


def _advice(cells: Sequence[CellMetadata], attitudes: set[str]) -> list[str]:
    """Return likely causes, and what to try, of recorded data; of simulated ones the faults are known."""
    recorded = [cell for cell in cells if cell["data"]]
    if not recorded:
        return []
    causes = ["gaps of the IMU", "its axes or stamps", "an acceleration noise of the filter that is too small"]
    moving = any(cell["spec"].get("dataset", {}).get("static_start_s") == 0.0 for cell in recorded)
    if moving and attitudes - {"reference"}:
        causes.insert(0, "a tilt that is wrong by degrees (static_start_s=0: it starts level, without a rest)")
    reference = "" if attitudes == {"reference"} else " attitude=reference, which tells whether the tilt is at fault;"
    tried = f"`jerkbench data inspect`;{reference} filter=eskf15; a larger filter.accel_mps2, or `jerkbench tune`"
    return [f"Likely causes: {'; '.join(causes)}. Try {tried}."]


def set_aside(names: list[str]) -> str:
    """Return a sentence about damaged files whose cells run again."""
    cells = "its cells" if len(names) == 1 else "their cells"
    return f"{damaged(names)} set aside, {cells} run again: {', '.join(map(plain, names))}."


def damaged(keys: list[str]) -> str:
    """Return the beginning of a sentence about files of cells that are damaged."""
    return "1 damaged file of cells is" if len(keys) == 1 else f"{len(keys)} damaged files of cells are"
