"""Tables with footnotes, the notes of a study, and the three table files of a study."""

import dataclasses
import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jerkbench import plugins
from jerkbench.errors import plain
from jerkbench.evaluation.correlated_errors import MIN_CORRELATION_TIMES
from jerkbench.evaluation.evaluated_run import Combination
from jerkbench.evaluation.intervals import GEOMETRIC, MEAN, MEDIAN, OUTLIER_FACTOR, share_interval
from jerkbench.files import write_atomically, write_text
from jerkbench.parameters import provenance_of
from jerkbench.report.columns import (
    FACTORS,
    GNSS_ONLY,
    MAIN,
    REFERENCE_METHODS,
    SCENARIO_FACTORS,
    declared,
    metric_columns,
    quantity,
    with_metric,
)
from jerkbench.report.comparisons import MAX_PAIRS, family_note, leaders_of
from jerkbench.report.findings import StudyVerdicts, is_rival, study_verdicts
from jerkbench.report.table_model import ABSENT, Grid, Table, TableCell, Values, arranged, first_of, range_text
from jerkbench.report.writers import latex, markdown, write_tidy_csv

if TYPE_CHECKING:
    import pandas as pd


# Footnotes of a table: constant factors, explanation of the numbers, and failures.

REASONS = 3
"""Maximum number of reasons of failures that a footnote lists."""

_KINDS = {
    GEOMETRIC: "Geometric mean of the successful runs and its 95 % interval (Student's t of the logarithms, "
    "{seeds} seeds).",
    MEDIAN: "Median of {seeds} seeds and its 95 % interval (order statistics). A failed run counts as infinite.",
    MEAN: "Mean of {seeds} seeds and its 95 % interval (BCa bootstrap; Student's t for fewer than 5 seeds).",
}
"""The footnote about the interval for each kind of average."""

GEOMETRIC_NOTE = "gm: geometric mean of the successful runs."

_BEST = "Bold: best in the row. No other method is significantly better, and at least one is significantly worse."


def footnoted(table: Table, rows: "pd.DataFrame", notes: Sequence[str] = (), family: str = "") -> Table:
    """Return ``table`` with added footnotes.

    Args:
        table: table without footnotes.
        rows: one row for each run.
        notes: further footnotes, which are added after the other footnotes.
        family: footnote about the significance tests.
    """
    cells = [cell for row in table.cells for cell in row if cell is not None]
    same = ", ".join(f"{key} {value}" for key, value in table.constants)
    constants = (f"In every cell: {same}.",) if same else ()
    texts = (*constants, *_reading(cells), *_ratios(table, cells, family), *_meaning(table, cells))
    return dataclasses.replace(table, footnotes=(*texts, *_trouble(cells, rows), *notes))


def _reading(cells: list[TableCell]) -> Iterator[str]:
    """Yield footnotes that explain the averages, the intervals, and the marks of the best methods."""
    seeded = [c for c in cells if c.interval and c.replicate == "seed"]
    for kind, template in _KINDS.items():
        used = [cell.runs if kind == MEDIAN else cell.used for cell in seeded if cell.kind == kind]
        if used:
            yield template.format(seeds=range_text(used))
    if any(c.geometric_text for c in cells):
        yield GEOMETRIC_NOTE
    recorded = [c for c in cells if c.recording_interval and c.used]
    if any(c.interval for c in recorded):
        phases = " (geometric means over its phases)" if any(c.used > 1 for c in recorded) else ""
        yield (
            f"[low, high] of one recording{phases}: 95 % moving-block bootstrap. It is valid for other parts of such a "
            "drive, not for other drives, and is not used for a test."
        )
    if any(not c.interval for c in recorded):
        yield (
            "No interval: the recording is too short, because its errors are correlated over more than "
            f"1/{MIN_CORRELATION_TIMES} of it."
        )
    if any(c.interval for c in cells if c.replicate == "phase" and not c.recording_interval):
        yield "{low–high}: range over the phases of one recording, not a confidence interval."  # noqa: RUF001 - a range
    if any(c.best for c in cells):
        yield _BEST


def _ratios(table: Table, cells: list[TableCell], family: str) -> Iterator[str]:
    """Yield footnotes that explain the ratios to the baseline and the marks of these ratios."""
    baseline = ", ".join(f"{key}={value}" for key, value in table.baseline)
    if any(c.factor for c in cells):
        yield f"×r: geometric mean of the ratio to {baseline} over the common seeds; median if runs failed."  # noqa: RUF001
        yield family


def _meaning(table: Table, cells: list[TableCell]) -> Iterator[str]:
    meaning = quantity(table.metric)
    if meaning.expected is not None:
        yield f"A consistent filter gives {meaning.expected:g}; {meaning.reading}."
    if any(c.number == "n/a" for c in cells):
        yield "n/a: the metric does not apply."
    if any(cell is None for row in table.cells for cell in row):
        yield f"{ABSENT}: this combination was not run."


def _trouble(cells: list[TableCell], rows: "pd.DataFrame") -> Iterator[str]:
    """Yield footnotes about diverged and failed runs, with the confidence interval of each failure rate."""
    if any(c.locked for c in cells):
        yield f"k/n locked out: the errors of k of n runs exceed {OUTLIER_FACTOR:g} times the median."
    if any((c.diverged or c.failed) and c.used for c in cells):
        counts = sorted({(c.diverged + c.failed, c.runs) for c in cells if c.replicate == "seed"})
        shares = [(f"{failed}/{runs}", *share_interval(failed, runs)) for failed, runs in counts if failed]
        if shares:
            texts = ", ".join(f"{count} {100 * low:.0f} to {100 * high:.0f} %" for count, low, high in shares)
            yield f"Diverged or failed runs, 95 % interval (Clopper and Pearson): {texts}."
        if any(c.kind == MEAN for c in cells):
            yield "The mean excludes diverged and failed runs."
    if any(c.missing and c.used for c in cells):
        yield "k/n n/a: k of n runs have no value of this metric. The average is over the other runs."
    if any(c.failed for c in cells):
        reasons = list(dict.fromkeys(rows.loc[rows["status"] == "failed", "reason"].astype(str)))
        more = f"; and {len(reasons) - REASONS} more" if len(reasons) > REASONS else ""
        yield "Failed: " + "; ".join(reason.rstrip(".") for reason in reasons[:REASONS]) + more + "."


# Notes of a study: notes about recordings, code versions, and results that are left out.

TUNED = "Tuned by jerkbench tune: "
"""Start of the note that tuned presets add to their runs. The tuning budget follows."""

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
        if names and floor > 0:  # the error of gnss_only at its own fixes is 0
            losing.append(f"{', '.join(scenario)}: {first_of(names, MAX_NAMED)}")
    return [f"Worse than {GNSS_ONLY}, which has no IMU: {first_of(losing, MAX_NAMED, '; ')}."] if losing else []


# The table of one metric.


FEW = 2_000
"""If a study has more combinations or more pairs to compare, only the main table marks the best methods.

More tests would take minutes.
"""

LEADING = (MAIN, "inclination_rmse_deg", "anis_per_row")
"""Candidates for the main metric of a study. The first candidate with a value is used.

The inclination is for attitude filters, and ANIS for recordings without a reference.
"""


def summarise(
    rows: "pd.DataFrame",
    metric: str,
    row_keys: Sequence[str] | None = None,
    column_keys: Sequence[str] | None = None,
    notes: Sequence[str] = (),
    baseline: Mapping[str, str] | None = None,
    verdicts: StudyVerdicts | None = None,
    *,
    leaders: bool = True,
) -> Table:
    """Return the table of one metric.

    Args:
        rows: one row for each combination and seed. The columns are the six factors, seed, replicate ("seed" or
            "phase"), status ("ok", "diverged", "failed"), reason, and the metrics.
        metric: column of the metric.
        row_keys: factors that define the rows (by default, all varying factors that do not define the columns).
        column_keys: factors that define the columns (by default, usually the adaptation; see `columns.layout`).
        notes: further footnotes, for example about combinations that were left out.
        baseline: values of the factors that define the baseline. The table shows the ratio of each combination to the
            combination that has these values and is equal in the other factors.
        verdicts: verdicts of the study for this metric, which determine the ratios and the best methods. If
            ``verdicts`` is None, the verdicts are computed from ``rows``.
        leaders: whether to mark the best methods of each row.

    Raises:
        JerkbenchError: the metric or a factor is unknown, or two rows have the same combination and seed.
    """
    grid = arranged(with_metric(rows, metric), row_keys, column_keys)
    if verdicts is None and (baseline or leaders):
        verdicts = study_verdicts(grid.rows, metric)
    cells, compared = grid.cells(metric), verdicts.against(baseline) if baseline and verdicts else []
    for one in compared:
        position = tuple(getattr(one.subject, key) for key in (*grid.across, *grid.down))
        cells[position] = cells[position]._replace(ratio=one)
    if leaders and verdicts:
        cells = with_leaders(cells, grid, verdicts)
    table = dataclasses.replace(grid.table(metric, cells), baseline=tuple((baseline or {}).items()))
    return footnoted(table, grid.rows, notes, family_note(compared))


def main_metric(rows: "pd.DataFrame") -> str:
    """Return the main metric of a study.

    The main metric is the first metric of `LEADING` that has a value in a successful run. If no metric of `LEADING` has
    a value, the main metric is the first other metric with a value. If no metric has a value, the main metric is
    `MAIN`.
    """
    valued = [column for column in metric_columns(rows) if rows.loc[rows["status"] == "ok", column].notna().any()]
    return next(iter([*(metric for metric in LEADING if metric in valued), *valued]), MAIN)


def with_leaders(cells: dict[Values, TableCell], grid: Grid, verdicts: StudyVerdicts) -> dict[Values, TableCell]:
    """Return ``cells`` in which the best methods of each row are marked.

    A row has marks only if each column of the table is a method, and if at least one method of the row is significantly
    worse than another method. If some of the best methods have neither failed runs nor missing values, only these
    methods are marked. Phases of a recording are not tested, so their rows have no marks.
    """
    if not verdicts.judged or not grid.down or {"dataset", "disturbance"} & set(grid.down):  # columns are scenarios
        return cells
    factors = grid.rows[[*FACTORS]].to_numpy(dtype=str)
    places = {Combination(*map(str, factors[runs[0]])): position for position, runs in grid.runs.items()}
    rows: dict[Values, list[Combination]] = {}  # competing combinations of each row
    for key, position in places.items():
        cell = cells[position]
        eligible = cell.replicate == "seed" and not cell.missing and not math.isnan(cell.mean)
        if eligible and is_rival(key, grid.down):
            rows.setdefault(position[: len(grid.across)], []).append(key)
    if sum(math.comb(len(field), 2) for field in rows.values()) > MAX_PAIRS:
        return cells
    pairs = {row: list(itertools.combinations(field, 2)) for row, field in rows.items()}
    every = [pair for of_row in pairs.values() for pair in of_row]
    compared = dict(zip(every, verdicts.compare(every), strict=True))
    marked = dict(cells)
    for row, field in rows.items():
        leaders = [places[key] for key in leaders_of(field, [compared[pair] for pair in pairs[row]])]
        complete = [position for position in leaders if cells[position].complete]  # without failed or missing runs
        for position in (complete or leaders) if len(leaders) < len(field) else ():
            marked[position] = marked[position]._replace(best=True)
    return marked


# The three table files of a study: table.md, table.csv, table.tex.


MANY_CELLS = 20_000
"""If a study has more combinations, table.md contains only the main table. The file table.csv contains all metrics."""


def write_tables(rows: "pd.DataFrame", folder: Path, notes: Sequence[str] = ()) -> Table:
    """Write table.md, table.csv and table.tex into ``folder``, and return the table of `main_metric`.

    Existing files are replaced atomically.

    Args:
        rows: one row for each combination and seed, as for `summarise`.
        folder: folder of the files. The folder is created if it does not exist.
        notes: further footnotes for the main table.
    """
    first = main_metric(rows)
    main = summarise(rows, first, notes=notes)
    grid = arranged(with_metric(rows, first), None, None)
    sections, known = {first: markdown(main, level=1)}, declared()
    wanted = sorted((name for name in known if known[name].section), key=lambda name: known[name].section)

    def tables() -> Iterator[Table]:
        """Yield all tables for table.csv. The sections of table.md are created from the same cells."""
        yield main
        for metric in metric_columns(rows):
            if metric != first:
                cells = grid.cells(metric)
                if metric in wanted and len(cells) <= MANY_CELLS:
                    sections[metric] = _section(grid, metric, cells, main.footnotes)
                yield grid.table(metric, cells)

    def write_csv(path: Path) -> None:
        with path.open("w", encoding="utf-8", newline="") as file:
            write_tidy_csv(tables(), file)

    write_atomically(folder / "table.csv", write_csv)
    ordered = (sections.get(metric) for metric in dict.fromkeys([first, *wanted]))
    write_text(folder / "table.md", "\n".join(filter(None, ordered)))
    write_text(folder / "table.tex", latex(main))
    return main


def _section(grid: Grid, metric: str, cells: dict[Values, TableCell], known: Sequence[str]) -> str:
    """Return the section of table.md for a metric other than the main metric. Without values, the text is empty.

    The best methods of a row are marked if the study has at most `FEW` combinations. Footnotes in ``known``, which are
    already below the main table, are left out.
    """
    if all(math.isnan(cell.mean) for cell in cells.values()):
        return ""
    if len(cells) <= FEW:
        cells = with_leaders(cells, grid, study_verdicts(grid.rows, metric, most=FEW))
    table = footnoted(grid.table(metric, cells), grid.rows)
    return markdown(dataclasses.replace(table, footnotes=tuple(n for n in table.footnotes if n not in known)))
