"""Rows of runs -> one table with its footnotes, and the three files that every study leaves."""

import dataclasses
import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.evaluation.correlated_errors import MIN_CORRELATION_TIMES
from jerkbench.evaluation.evaluated_run import Combination
from jerkbench.evaluation.intervals import ENOUGH, OUTLIER_FACTOR, share_interval
from jerkbench.evaluation.over_seeds import GEOMETRIC, MEAN, MEDIAN
from jerkbench.files import write_atomically, write_text
from jerkbench.report.columns import (
    FACTORS,
    declared,
    metric_columns,
    quantity,
    standing_apart,
    with_metric,
)
from jerkbench.report.comparisons import MAX_PAIRS, family_note, leaders_of
from jerkbench.report.study_verdicts import StudyVerdicts, is_rival, study_verdicts
from jerkbench.report.table_model import ABSENT, Grid, Table, TableCell, Values, arranged, number
from jerkbench.report.writers import csv_labels, csv_lines, latex, markdown, tidy_csv

if TYPE_CHECKING:
    import pandas as pd


BOUNDED, _BOUND = "position_rmse_m", "position_bound_m"
"""The metric that has a bound, and the column with it."""

_SCENARIO = ("dataset", "disturbance")
"""What a bound depends on; attitude and method do not enter."""

LABEL = "bound"
"""The filter's name in the row."""

_TOLD = 6
"""Of how many scenarios the footnote gives the number."""

ToldScenario = tuple[str, ...]


def with_bounds(table: Table, rows: "pd.DataFrame") -> Table:
    """Return ``table`` with a row for each scenario whose bound is known, where its rows are filters."""
    if table.metric != BOUNDED or "filter" not in table.row_keys or set(_SCENARIO) & set(table.column_keys):
        return table
    bounds, lines = known_bounds(rows), list(zip(table.rows, table.cells, strict=True))
    scenarios = [_scenario(table, row) for row, _ in lines]
    for scenario, bound in bounds.items():
        if scenario in scenarios:
            at = len(scenarios) - scenarios[::-1].index(scenario)
            labels_of = dict(zip(_SCENARIO, scenario, strict=True)) | {"filter": LABEL}
            head = tuple(labels_of.get(key, "") for key in table.row_keys)
            lines.insert(at, (head, (bound,) * len(table.columns)))
            scenarios.insert(at, scenario)
    labels, cells = zip(*lines, strict=True) if lines else ((), ())
    return dataclasses.replace(table, rows=labels, cells=cells)


def bound_note(metric: str, rows: "pd.DataFrame") -> Iterator[str]:
    """Yield what the bound is, and of which scenarios none is known."""
    if metric != BOUNDED or _BOUND not in rows.columns:
        return
    bounds = known_bounds(rows)
    count = len(rows[[*_SCENARIO]].drop_duplicates())
    told = [f"{number(bound.mean)} ({', '.join(scenario)})" for scenario, bound in bounds.items()]
    more = [f"{len(told) - _TOLD} more"] if len(told) > _TOLD else []
    unknown = [f"not known for {count - len(told)} of {count} scenarios"] if len(told) < count else []
    yield (
        "Posterior Cramér-Rao bound, from the true noises: without hindsight, and with the motion unknown, no filter's"
        f" mean square is below it [m]: {', '.join([*told[:_TOLD], *more, *unknown])}."
    )


def known_bounds(rows: "pd.DataFrame") -> dict[ToldScenario, TableCell]:
    """Return the root mean square over seeds of each scenario whose bound is known."""
    if _BOUND not in rows.columns:
        return {}
    known = rows[np.isfinite(rows[_BOUND].to_numpy(dtype=float)) & (rows["status"] == "ok").to_numpy()]
    bounds = {}
    for scenario, of in known.groupby([*_SCENARIO], sort=False):
        seeds = of.groupby("seed")[_BOUND].min().to_numpy()
        cell = TableCell(float(np.sqrt(np.mean(seeds**2))), math.nan, math.nan, len(seeds))
        bounds[tuple(map(str, scenario))] = cell
    return bounds


def _scenario(table: Table, row: tuple[str, ...]) -> ToldScenario:
    values = dict(table.constants) | dict(zip(table.row_keys, row, strict=True))
    return tuple(values[key] for key in _SCENARIO)


# The sentences under a table: what is the same everywhere, how to read a cell, what went wrong.

REASONS = 3
"""How many different reasons of failures are told."""

_KINDS = {
    GEOMETRIC: "Geometric mean [low, high] of the runs that went well: Student's 95 % interval of the logarithms over "
    "{seeds} seeds.",
    MEDIAN: "Median [low, high]: of all {seeds} seeds, a lost run larger than every number; 95 % by order statistics. "
    "gm: geometric mean of the runs that went well.",
    MEAN: "Mean [low, high]: 95 % BCa bootstrap interval over {seeds} seeds, of fewer than 5 Student's.",
}
"""What stands in a cell."""

_FEW = f" Of fewer than {ENOUGH} it is widened for skewed errors."
"""What is added where cells of few seeds have it."""

AT_THE_END = ("outage_end_m", "outage_end_max_m")
"""Metrics of which the number of outages is told."""


def footnoted(table: Table, rows: "pd.DataFrame", notes: Sequence[str] = (), family: str = "") -> Table:
    """Return ``table`` with its bounds, and with the sentences under it.

    Of its tests they say what ``family`` does; the caller's ``notes`` are at the end.
    """
    table = with_bounds(table, rows)
    cells = [cell for row in table.cells for cell in row if cell is not None]
    limits = (*bound_note(table.metric, rows), *_outages(table, rows))
    alike = ", ".join(f"{key} {value}" for key, value in table.constants)
    constants = (f"In every cell: {alike}.",) if alike else ()
    told = (*constants, *_reading(table, cells, family), *limits, *_trouble(cells, rows), *notes)
    return dataclasses.replace(table, footnotes=told)


def _reading(table: Table, cells: list[TableCell], family: str) -> Iterator[str]:
    """How to read the numbers."""
    yield from _intervals([c for c in cells if c.interval and c.replicate == "seed"])
    yield from _of_one_recording([c for c in cells if c.own_interval and c.used])
    if any(c.interval for c in cells if c.replicate == "phase" and not c.own_interval):
        yield "{low–high}: range over the phases of one recording: not a confidence interval."  # noqa: RUF001 - a range
    if any(c.best for c in cells):
        leaders = "Bold: the leaders of the row: others were shown to be worse, they were not."
        yield f"{leaders} {standing_apart(_labels(table))}".strip()
    yield from _ratios(table, cells, family)
    meaning = quantity(table.metric)
    if meaning.expected is not None:
        yield f"A consistent filter gives {meaning.expected:g}; {meaning.reading}."
    if any(c.number == "n/a" for c in cells):
        yield "n/a: the metric does not apply."
    if any(cell is None for row in table.cells for cell in row):
        yield f"{ABSENT}: this combination was not run."


def _of_one_recording(cells: list[TableCell]) -> Iterator[str]:
    """How to read the intervals of one recording, and why some cells have none."""
    if any(c.interval for c in cells):
        phases = " (geometric means over its phases)" if any(c.used > 1 for c in cells) else ""
        yield (
            f"[low, high] of one recording{phases}: 95 % moving-block bootstrap; it speaks for other stretches of such "
            "a drive, not for other drives, and carries no test."
        )
    if any(not c.interval for c in cells):
        yield (
            "No interval: the recording is too short to say, as its errors are alike for more than "
            f"1/{MIN_CORRELATION_TIMES} of it."
        )


def _labels(table: Table) -> dict[str, set[str]]:
    """The labels of each factor."""
    columns, rows = (zip(*values, strict=True) for values in (table.columns, table.rows))
    of = zip((*table.column_keys, *table.row_keys), (*columns, *rows), strict=True)
    return {**{key: {value} for key, value in table.constants}, **{key: set(values) for key, values in of}}


def _intervals(cells: list[TableCell]) -> Iterator[str]:
    """What the brackets are, for each kind of centre."""
    for kind, words in _KINDS.items():
        used = [cell.runs if kind == MEDIAN else cell.used for cell in cells if cell.kind == kind]
        if used:
            seeds = f"{max(used)}" if min(used) == max(used) else f"{min(used)} to {max(used)}"
            few = kind == GEOMETRIC and min(used) < ENOUGH
            yield words.format(seeds=seeds) + (_FEW if few else "")


def _ratios(table: Table, cells: list[TableCell], family: str) -> Iterator[str]:
    """What the factors in the cells are, and what their marks mean."""
    baseline = ", ".join(f"{key}={value}" for key, value in table.baseline)
    if not any(c.factor for c in cells):
        if baseline:
            yield f"There is no ratio to {baseline}: no seed has a value above 0 in both."
        return
    yield f"×r: geometric mean of the ratio to {baseline} over the common seeds; with lost runs the median."  # noqa: RUF001
    if table.average == MEAN:
        yield "The means are arithmetic: their quotient is another number than ×r."  # noqa: RUF001
    yield family


def _outages(table: Table, rows: "pd.DataFrame") -> Iterator[str]:
    """How many outages an error at their end is taken from."""
    if table.metric not in AT_THE_END or "outages_counted" not in rows.columns:
        return
    counts = rows.loc[rows["status"] == "ok", "outages_counted"].dropna()
    if len(counts):
        low, high = int(counts.min()), int(counts.max())
        yield f"Outages of a run with a known error at the end: {low if low == high else f'{low} to {high}'}."


def _trouble(cells: list[TableCell], rows: "pd.DataFrame") -> Iterator[str]:
    if any(c.locked for c in cells):
        yield f"k/n locked out: k of n runs are over {OUTLIER_FACTOR:g} times the median."
    if any((c.diverged or c.failed) and c.used for c in cells):
        yield from _shares(cells)
    if any(c.missing and c.used for c in cells):
        yield "k/n n/a: k of n runs have no value of this metric, and the number is of the others."
    if any(c.failed for c in cells):
        reasons = list(dict.fromkeys(rows.loc[rows["status"] == "failed", "reason"].astype(str)))
        more = f"; and {len(reasons) - REASONS} more" if len(reasons) > REASONS else ""
        yield "Failed: " + "; ".join(reason.rstrip(".") for reason in reasons[:REASONS]) + more + "."


def _shares(cells: list[TableCell]) -> Iterator[str]:
    """The intervals of the shares of lost runs, each count once."""
    counts = dict.fromkeys((c.diverged + c.failed, c.runs) for c in cells if c.replicate == "seed")
    told = []
    for lost, runs in sorted(counts):
        low, high = share_interval(lost, runs)
        told += [f"{lost}/{runs} {100 * low:.0f} to {100 * high:.0f} %"] * bool(lost)
    if told:
        yield f"Lost runs, 95 % (Clopper and Pearson): {', '.join(told)}."
    if any(c.kind == MEAN for c in cells):
        yield "Of lost runs this metric says nothing: the mean is over the others."


# Rows of runs -> one table, and the three files that every study leaves.


MAIN = "position_rmse_m"
"""The metric of a table for which none is asked."""


FEW_PAIRS = 2_000
"""Where there are more pairs of cells in rows, the leaders of a row are marked only in the table that is asked for."""

FEW_CELLS = 2_000
"""Where there are more combinations, nothing is judged but in the table that is asked for: it takes minutes."""

LEADING = (MAIN, "inclination_rmse_deg", "anis_per_row")
"""What leads a study for which it was computed; the second of attitude alone, the third without a reference."""


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
        rows: one row a cell and seed: the six factors, seed, replicate ("seed" or "phase"), status ("ok", "diverged",
            "failed"), reason, and the metrics.
        metric: which metric's column.
        row_keys: factors of the rows; without them, all that vary and are not columns.
        column_keys: factors of the columns; without them the adaptation.
        notes: sentences to put under the table, such as which combinations were left out and why.
        baseline: values of factors; each cell then has its ratio to the cell that is like it but for these.
        verdicts: of the study in this metric, for the ratios and for who leads a row; without them they are made.
        leaders: whether to mark who leads a row.

    Raises:
        JerkbenchError: no such metric or factor, or two rows of the same combination and seed.
    """
    grid = arranged(with_metric(rows, metric), row_keys, column_keys)
    if verdicts is None and (baseline or leaders):
        verdicts = study_verdicts(grid.rows, metric)
    cells, compared = grid.cells(metric), verdicts.against(baseline) if baseline and verdicts else []
    for one in compared:
        place = tuple(getattr(one.subject, key) for key in (*grid.across, *grid.down))
        cells[place] = cells[place]._replace(ratio=one)
    if leaders and verdicts:
        cells = with_leaders(cells, grid, verdicts)
    table = dataclasses.replace(grid.table(metric, cells), baseline=tuple((baseline or {}).items()))
    return footnoted(table, grid.rows, notes, family_note(compared))


def main_metric(rows: "pd.DataFrame") -> str:
    """Return the first of `LEADING` that has a value, else the first metric that has one, else `MAIN`."""
    valued = [column for column in metric_columns(rows) if rows.loc[rows["status"] == "ok", column].notna().any()]
    return next(iter([*(metric for metric in LEADING if metric in valued), *valued]), MAIN)


def with_leaders(cells: dict[Values, TableCell], grid: Grid, verdicts: StudyVerdicts) -> dict[Values, TableCell]:
    """Mark the leaders of each row, whose columns are methods: where anybody was shown to be worse than another.

    A cell that lost runs, or has no value in some, is not marked beside one that did not; without seeds there is no
    test, and nobody leads.
    """
    if not verdicts.judged or not grid.down or {"dataset", "disturbance"} & set(grid.down):  # else scenarios compete
        return cells
    factors = grid.rows[[*FACTORS]].to_numpy(dtype=str)
    places = {Combination(*map(str, factors[runs[0]])): place for place, runs in grid.runs.items()}
    rows: dict[Values, list[Combination]] = {}  # the combinations of each row that compete
    for key, place in places.items():
        cell = cells[place]
        eligible = cell.replicate == "seed" and not cell.missing and not math.isnan(cell.mean)
        if eligible and is_rival(key, grid.down):
            rows.setdefault(place[: len(grid.across)], []).append(key)
    fields = [field for field in rows.values() if len(field) > 1]
    counts = [math.comb(len(field), 2) for field in fields]
    if sum(counts) > MAX_PAIRS:
        return cells
    pairs = itertools.chain.from_iterable(itertools.combinations(field, 2) for field in fields)
    comparisons = iter(verdicts.compare(pairs))
    marked = dict(cells)
    for field, count in zip(fields, counts, strict=True):
        leaders = [places[key] for key in leaders_of(field, list(itertools.islice(comparisons, count)))]
        whole = [place for place in leaders if cells[place].complete]  # lost no runs
        for place in (whole or leaders) if len(leaders) < len(field) else ():
            marked[place] = marked[place]._replace(best=True)
    return marked


# The three files that every study leaves: table.md, table.csv, table.tex.


def sections_wanted() -> list[str]:
    """Return the columns that get a section in table.md after the main one, in their order; table.csv has all."""
    return sorted((name for name, of in declared().items() if of.section), key=lambda name: declared()[name].section)


MANY_CELLS = 20_000
"""Of more combinations table.md has the first table alone; a reader of the others takes table.csv."""


def write_tables(rows: "pd.DataFrame", folder: Path, notes: Sequence[str] = ()) -> Table:
    """Write table.md, table.csv and table.tex into ``folder``; returns the table of `main_metric`, all of the last.

    Args:
        rows: as for `summarise`.
        folder: made where it is not there; each file is replaced as a whole.
        notes: sentences that go under the first table.
    """
    first = main_metric(rows)
    main = summarise(rows, first, notes=notes)
    grid = arranged(with_metric(rows, first), None, None)
    places, labels = (
        grid.in_order(),
        csv_labels(grid.table(first, grid.cells(first))),
    )  # of the runs: the first table has bounds besides
    sections, wanted = {first: markdown(main, level=1)}, sections_wanted()

    def write_csv(path: Path) -> None:
        """Write table.csv; sections of table.md are made on the way, while the numbers of their metric are there."""
        with path.open("w", encoding="utf-8", newline="") as file:  # of very many cells a metric at a time is in memory
            file.write(tidy_csv([main]))
            for metric in metric_columns(rows):
                if metric == first:
                    continue
                each = grid.each_cell(metric, places)
                if metric in wanted and len(places) <= MANY_CELLS:
                    cells = grid.cells(metric)
                    sections[metric] = _section(grid, metric, cells, main.footnotes)
                    in_order = list(cells.values())
                    each = (in_order[place] for place in places)
                file.writelines(csv_lines(metric, quantity(metric).unit, each, labels))

    write_atomically(folder / "table.csv", write_csv)
    ordered = (sections.get(metric) for metric in dict.fromkeys([first, *wanted]))
    write_text(folder / "table.md", "\n".join(filter(None, ordered)))
    write_text(folder / "table.tex", latex(main))
    return main


def _section(grid: Grid, metric: str, cells: dict[Values, TableCell], known: Sequence[str]) -> str:
    """Return the table of a metric for which nobody asked; nothing where it has no value.

    Who leads a row is marked where that takes no minutes; footnotes that are ``known`` are left out.
    """
    if all(math.isnan(cell.mean) for cell in cells.values()):
        return ""
    if len(cells) <= FEW_CELLS:
        cells = with_leaders(cells, grid, study_verdicts(grid.rows, metric, most=FEW_PAIRS))
    table = footnoted(grid.table(metric, cells), grid.rows)
    return markdown(dataclasses.replace(table, footnotes=tuple(n for n in table.footnotes if n not in known)))
