"""Notes below the tables of a study: notes about recordings, code versions, and results that are left out."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from jerkbench import plugins
from jerkbench.notices import plain
from jerkbench.parameters import provenance_of
from jerkbench.report.columns import FACTORS, GNSS_ONLY, MAIN, REFERENCE_METHODS, SCENARIO_FACTORS

if TYPE_CHECKING:
    import pandas as pd

WORSE_RATIO = 1.1
"""A method is reported if its median error is more than this factor times the error of the fixes alone."""

MAX_NAMED = 3
"""Maximum number of scenarios and of methods in a scenario that a note lists."""

JobMetadata = Mapping[str, Any]
"""Metadata of a stored job: labels, spec, data, notes, versions of the code."""


def notes_of_study(
    rows: "pd.DataFrame",
    jobs: Sequence[JobMetadata],
    configured: Sequence[str],
    *,
    outdated: int,
    other_runs: int,
    damaged: Sequence[str],
) -> list[str]:
    """Return the notes below the tables of a study.

    Args:
        rows: one row for each job and seed of the study.
        jobs: metadata of each job of the study.
        configured: notes from the configuration of the study, which come before all other notes.
        outdated: number of stored jobs that tables leave out because a newer job has the same labels.
        other_runs: number of stored runs that tables leave out because the last command used other seeds.
        damaged: names of damaged files with results.
    """
    notes = list(dict.fromkeys([*configured, *(note for job in jobs for note in job["notes"])]))
    codes = {(job["code"], *sorted(job["versions"].items())) for job in jobs}
    if len(codes) > 1:
        notes.append(f"These results come from {len(codes)} versions of the code or its libraries.")
    if len(kinds := {kind for job in jobs if (kind := job.get("processor"))}) > 1:
        named = ", ".join(sorted({kind.partition(":")[0] for kind in kinds}))
        notes.append(f"These results come from {len(kinds)} kinds of processors ({named}): last bits may differ.")
    if outdated:
        which = "1 result of the same name" if outdated == 1 else f"{outdated} results of the same names"
        notes.append(f"{which} with other settings, code or data {'is' if outdated == 1 else 'are'} left out.")
    if other_runs:
        which = "1 stored run is" if other_runs == 1 else f"{other_runs} stored runs are"
        notes.append(f"{which} left out: the last command used other seeds.")
    if damaged:
        notes.append(f"{damaged_files(damaged)} left out: {', '.join(map(plain, damaged))}.")
    return [*notes, *_provenance_notes(jobs), *_worse_than_fixes(rows)]


def notes_of_part(
    notes: Iterable[str], jobs: Iterable[JobMetadata], selected: Iterable[JobMetadata]
) -> tuple[str, ...]:
    """Return the notes of a study without the notes that belong only to jobs that are not selected."""
    of_jobs, left = ({note for job in several for note in job["notes"]} for several in (jobs, selected))
    return tuple(note for note in notes if note in left or note not in of_jobs)


def code_of(jobs: Sequence[JobMetadata]) -> str:
    """Return text with the commit that computed all jobs, or with the number of different commits.

    If the commit of a job is unknown, the first digits of the hash of the code replace the commit.
    """
    named = {job["commit"] or f"code {job['code'][:12]}" for job in jobs}
    return f"{len(named)} versions of the code" if len(named) > 1 else f"commit {named.pop()}"


def damaged_files(names: Sequence[str]) -> str:
    """Return the start of a message: the number of damaged files, followed by "is" or "are"."""
    return "1 damaged file of results is" if len(names) == 1 else f"{len(names)} damaged files of results are"


def _provenance_notes(cells: Sequence[JobMetadata]) -> list[str]:
    """Return a note that lists the simplified and the unpublished methods of a study, except reference methods."""
    named_by_kind: dict[str, list[str]] = {"simplified": [], "own": []}
    for kind, name in sorted({(kind, str(cell["spec"][kind]["name"])) for cell in cells for kind in REFERENCE_METHODS}):
        known = provenance_of(plugins.get(kind, name)) if name in plugins.names(kind) else None
        if known and known.kind in named_by_kind and name != REFERENCE_METHODS[kind]:
            named_by_kind[known.kind].append(name)
    named = "; ".join(f"{kind}: {', '.join(names)}" for kind, names in named_by_kind.items() if names)
    return [f"Not as published: {named}. `jerkbench show` describes the differences."] if named else []


def _worse_than_fixes(rows: "pd.DataFrame") -> list[str]:
    """Return a note about methods whose errors are larger than the errors of the fixes, or no note."""
    if MAIN not in rows.columns or not (rows["filter"] == GNSS_ONLY).any():
        return []
    run = rows[rows["status"] != "failed"]
    errors = run[MAIN].where(run["status"] == "ok", float("inf"))
    medians: Any = errors.groupby([run[key].astype(str) for key in FACTORS]).median()
    losing = []
    for scenario, methods in medians.groupby(level=[*SCENARIO_FACTORS]):
        floor = methods[methods.index.get_level_values("filter") == GNSS_ONLY].min()
        worse = methods[methods > WORSE_RATIO * floor].sort_values(ascending=False, kind="stable")
        names = ["+".join(name for name in labels[3:] if name not in ("none", "default")) for labels in worse.index]
        if names:
            losing.append(f"{', '.join(scenario)}: {_first(names)}")
    return [f"Worse than {GNSS_ONLY}, which has no IMU: {_first(losing, '; ')}."] if losing else []


def _first(texts: Sequence[str], separator: str = ", ") -> str:
    """Return the first `MAX_NAMED` texts, and the number of the other texts."""
    more = f" and {len(texts) - MAX_NAMED} more" if len(texts) > MAX_NAMED else ""
    return separator.join(texts[:MAX_NAMED]) + more
