"""The notes below the tables of a study: its recordings, its code, and the results that are left out."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from jerkbench import plugins
from jerkbench.notices import plain
from jerkbench.parameters import provenance_of
from jerkbench.report.columns import FACTORS, GNSS_ONLY, SCENARIO_FACTORS, WHY
from jerkbench.report.labels import contradiction

if TYPE_CHECKING:
    import pandas as pd

ERROR_COLUMN = "position_rmse_m"

WORSE_RATIO = 1.1
"""A method is reported if its median error is larger than that of the fixes alone by this factor."""

MAX_NAMED = 3
"""Scenarios, methods of a scenario, and wrong labels that are named."""

JobMetadata = Mapping[str, Any]
"""The metadata of a stored job."""


class LeftOut(NamedTuple):
    """Results of a study that are not shown.

    Attributes:
        outdated: number of jobs whose labels are those of a newer one.
        runs: number of runs with seeds that are not shown.
        damaged: names of damaged files.
    """

    outdated: int
    runs: int
    damaged: Sequence[str]


def notes_of_study(
    rows: "pd.DataFrame", jobs: Sequence[JobMetadata], configured: Sequence[str], left_out: LeftOut
) -> list[str]:
    """Return the notes below the tables of a study.

    Args:
        rows: of the study.
        jobs: the metadata of each of its jobs.
        configured: notes of the configuration, which come first.
        left_out: results that are not shown.
    """
    recorded = dict.fromkeys([*configured, *(note for job in jobs for note in job["notes"])])
    return [
        *recorded,
        *_origin_notes(jobs),
        *_left_out_notes(left_out),
        *_label_notes(jobs),
        *_damage_notes(left_out.damaged),
        *_provenance_notes(jobs),
        *_worse_than_fixes(rows, jobs),
    ]


def code_of(jobs: Sequence[JobMetadata]) -> str:
    """Return the commit, or the number of commits. Without a commit, the first digits of the digest of the code."""
    named = {job["commit"] or f"code {job['code'][:12]}" for job in jobs}
    return f"{len(named)} versions of the code" if len(named) > 1 else f"commit {named.pop()}"


def damaged_files(names: Sequence[str]) -> str:
    """Return the beginning of a message about damaged files."""
    return "1 damaged file of cells is" if len(names) == 1 else f"{len(names)} damaged files of cells are"


def _origin_notes(jobs: Sequence[JobMetadata]) -> Iterator[str]:
    codes = {(job["code"], *sorted(job["versions"].items())) for job in jobs}
    if len(codes) > 1:
        yield f"These results come from {len(codes)} versions of the code or its libraries."
    if len(kinds := {kind for job in jobs if (kind := job.get("processor"))}) > 1:
        named = ", ".join(sorted({kind.partition(":")[0] for kind in kinds}))
        yield f"These results come from {len(kinds)} kinds of processors ({named}): last bits may differ."


def _left_out_notes(left_out: LeftOut) -> Iterator[str]:
    if count := left_out.outdated:
        which = "1 result of the same name" if count == 1 else f"{count} results of the same names"
        yield f"{which} with other settings, code or data {'is' if count == 1 else 'are'} left out."
    if count := left_out.runs:
        which = "1 stored run is" if count == 1 else f"{count} stored runs are"
        yield f"{which} left out: the last command asked for other seeds."


def _label_notes(jobs: Sequence[JobMetadata]) -> Iterator[str]:
    if wrong := list(dict.fromkeys(filter(None, (contradiction(job["labels"], job["spec"]) for job in jobs)))):
        yield f"Labels name another plugin than ran: {'; '.join(map(plain, wrong[:MAX_NAMED]))}."


def _damage_notes(names: Sequence[str]) -> Iterator[str]:
    if names:
        yield f"{damaged_files(names)} left out: {', '.join(map(plain, names))}."


def _provenance_notes(cells: Sequence[JobMetadata]) -> list[str]:
    """Return which of the methods are simplified or nobody's but ours; what competes with nobody is left out."""
    told: dict[str, list[str]] = {"simplified": [], "own": []}
    for kind, name in sorted({(kind, str(cell["spec"][kind]["name"])) for cell in cells for kind in WHY}):
        known = provenance_of(plugins.get(kind, name)) if name in plugins.names(kind) else None
        if known and known.kind in told and name not in WHY[kind]:
            told[known.kind].append(name)
    named = "; ".join(f"{kind}: {', '.join(names)}" for kind, names in told.items() if names)
    return [f"Not as published: {named}. `jerkbench show` says what differs."] if named else []


def _worse_than_fixes(rows: "pd.DataFrame", jobs: Sequence[JobMetadata]) -> list[str]:
    """Return which methods have larger errors than the fixes without an IMU, the likely causes, and what to try."""
    if ERROR_COLUMN not in rows.columns or not (rows["filter"] == GNSS_ONLY).any():
        return []
    run = rows[rows["status"] != "failed"]
    errors = run[ERROR_COLUMN].where(run["status"] == "ok", float("inf"))
    medians: Any = errors.groupby([run[key].astype(str) for key in FACTORS]).median()
    losing = {}
    for scenario, methods in medians.groupby(level=[*SCENARIO_FACTORS]):
        floor = methods[methods.index.get_level_values("filter") == GNSS_ONLY].min()
        if len(worse := methods[methods > WORSE_RATIO * floor].sort_values(ascending=False, kind="stable")):
            losing[scenario] = _losers(scenario, worse, floor)
    if not losing:
        return []
    left = len(losing) - MAX_NAMED
    more = [f"Methods lose to {GNSS_ONLY} in {left} more scenarios."] * (left > 0)
    return [*list(losing.values())[:MAX_NAMED], *_advice(jobs, {scenario[-1] for scenario in losing}), *more]


def _losers(scenario: tuple[str, ...], worse: "pd.Series[float]", floor: float) -> str:
    named = []
    for labels, error_m in zip(worse.index.tolist(), worse.tolist(), strict=True):
        method = "+".join(name for name in labels[len(SCENARIO_FACTORS) :] if name not in ("none", "default"))
        named.append(f"{method} ({f'{error_m:.3g} m' if error_m < float('inf') else 'lost'})")
    more = f" and {len(named) - MAX_NAMED} more" if len(named) > MAX_NAMED else ""
    where, worst = ", ".join(scenario), ", ".join(named[:MAX_NAMED])
    return f"Worse than {GNSS_ONLY} ({floor:.3g} m), which has no IMU, in {where}: {worst}{more}."


def _advice(cells: Sequence[JobMetadata], attitudes: set[str]) -> list[str]:
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
