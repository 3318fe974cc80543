"""Rows of runs -> one table."""

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.evaluation.statistics.centre import GEOMETRIC, MEAN, Centre, centre
from jerkbench.evaluation.statistics.intervals import mean_intervals
from jerkbench.report.analysis.comparison import RULE, Combination, Comparison, Rule, compare_to, family_note, grouped
from jerkbench.report.analysis.factors import FACTORS, constants
from jerkbench.report.analysis.leading import MOST_PAIRS, contests
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.analysis.references import attitude_competes
from jerkbench.report.analysis.rows import metric_columns, with_metric
from jerkbench.report.tables.footnotes import footnotes
from jerkbench.report.tables.grid import Grid, Values, arranged
from jerkbench.report.tables.table_model import Cell, Ratio, Table

if TYPE_CHECKING:
    import pandas as pd

MAIN = "position_rmse_m"
"""The metric of a table for which none is asked."""


FEW_PAIRS = 2_000
"""Where there are more pairs of cells in rows, the leaders of a row are marked only in the table that is asked for."""

LEADING = (MAIN, "inclination_rmse_deg", "anis_per_row")
"""What leads a study for which it was computed; the second of attitude alone, the third without a reference."""


def summarise(
    rows: "pd.DataFrame",
    metric: str,
    row_keys: Sequence[str] | None = None,
    column_keys: Sequence[str] | None = None,
    notes: Sequence[str] = (),
    baseline: Mapping[str, str] | None = None,
    rule: Rule = RULE,
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
        rule: how differences are judged: the ratios, and who leads a row.

    Raises:
        JerkbenchError: no such metric or factor, or two rows of the same combination and seed.
    """
    rows = with_metric(rows, metric)
    return _table(arranged(rows, row_keys, column_keys), metric, notes, baseline or {}, rule)


def summarise_each(
    rows: "pd.DataFrame",
    metrics: Iterable[str],
    row_keys: Sequence[str] | None = None,
    column_keys: Sequence[str] | None = None,
) -> dict[str, Table]:
    """Return the tables of several metrics: `summarise` of each, with what they share done once."""
    grid = arranged(rows, row_keys, column_keys)
    return {metric: _table(grid, metric, (), {}, RULE, FEW_PAIRS) for metric in metrics}


def main_metric(rows: "pd.DataFrame") -> str:
    """Return the first of `LEADING` that has a value, else the first metric that has one, else `MAIN`."""
    valued = [column for column in metric_columns(rows) if rows.loc[rows["status"] == "ok", column].notna().any()]
    return next(iter([*(metric for metric in LEADING if metric in valued), *valued]), MAIN)


def _table(
    grid: Grid, metric: str, notes: Sequence[str], baseline: Mapping[str, str], rule: Rule, most: int = MOST_PAIRS
) -> Table:
    rule = rule.of(grid.rows)
    comparisons = compare_to(grid.rows, metric, baseline, rule) if baseline else []
    cells = _with_ratios(_cells(grid, metric), comparisons, (*grid.across, *grid.down))
    what = quantity(metric)
    if what.lowest_is_best:
        cells = with_leaders(cells, grid, metric, rule, most)
    lines = [[cells.get((*row, *column)) for column in grid.column_values] for row in grid.row_values]
    table = Table(
        title=what.heading,
        metric=metric,
        unit=what.unit,
        row_keys=grid.across,
        column_keys=grid.down,
        rows=grid.row_values,
        columns=grid.column_values,
        cells=tuple(tuple(line) for line in lines),
        constants=constants(grid.rows, (*grid.across, *grid.down)),
        baseline=tuple(baseline.items()),
        average=GEOMETRIC if _of_positive_errors(grid, metric) else MEAN,
    )
    return dataclasses.replace(table, footnotes=footnotes(table, grid.rows, notes, family_note(comparisons)))


def _cells(grid: Grid, metric: str) -> dict[Values, Cell]:
    values = grid.rows[metric].to_numpy(dtype=float)
    errors = np.where(grid.status == "ok", values, np.inf)
    good = {key: values[runs[grid.status[runs] == "ok"]] for key, runs in grid.runs.items()}
    if _of_positive_errors(grid, metric):
        centres = {key: _of_errors(errors[runs], good[key]) for key, runs in grid.runs.items()}
    else:
        intervals = mean_intervals(list(good.values()))
        centres = {
            key: Centre(MEAN, one.mean, one.low, one.high, (np.nan, np.nan), 0)
            for key, one in zip(good, intervals, strict=True)
        }
    return {key: _cell(grid, runs, good[key], centres[key]) for key, runs in grid.runs.items()}


def _of_positive_errors(grid: Grid, metric: str) -> bool:
    """Whether the metric is an error of which a geometric mean, or a median with losses at the top, makes sense."""
    good = grid.rows[metric].to_numpy(dtype=float)[grid.status == "ok"]
    return quantity(metric).lowest_is_best and not bool(np.any(good < 0))


def _of_errors(errors: FloatArray, good: FloatArray) -> Centre:
    """Return the centre of all runs; of none that has a value nothing."""
    if np.isnan(good).all():
        return Centre(GEOMETRIC, np.nan, np.nan, np.nan, (np.nan, np.nan), 0)
    return centre(errors)


def _cell(grid: Grid, runs: IntArray, good: FloatArray, found: Centre) -> Cell:
    phase = bool(grid.phase[runs].any())
    low, high = _range(good) if phase else (found.low, found.high)
    diverged, failed = (int((grid.status[runs] == name).sum()) for name in ("diverged", "failed"))
    missing = int(np.isnan(good).sum())
    return Cell(
        *(found.value, low, high, len(runs), diverged, failed, missing),
        replicate="phase" if phase else "seed",
        kind=found.kind,
        locked=found.locked,
        quartiles=found.quartiles,
    )


def _with_ratios(
    cells: dict[Values, Cell], comparisons: Sequence[Comparison], keys: tuple[str, ...]
) -> dict[Values, Cell]:
    """Put each comparison into the cell of its subject."""
    compared = dict(cells)
    for one in comparisons:
        place = tuple(dict(zip(FACTORS, one.subject, strict=True))[key] for key in keys)
        found = one.judgement
        ratio = Ratio(found.ratio, found.low, found.high, found.p, one.mark, found.median)
        compared[place] = dataclasses.replace(compared[place], ratio=ratio)
    return compared


def _range(values: FloatArray) -> tuple[float, float]:
    """Return the smallest and the largest; one phase has no range."""
    known = values[~np.isnan(values)]
    return (float(known.min()), float(known.max())) if len(known) > 1 else (np.nan, np.nan)


def with_leaders(cells: dict[Values, Cell], grid: Grid, metric: str, rule: Rule, most: int) -> dict[Values, Cell]:
    """Mark the leaders of each row, whose columns are methods: where anybody was shown to be worse than another.

    All pairs of all rows are one family. A cell that lost runs, or has no value in some, is not marked beside one that
    did not; without seeds there is no test, and nobody leads.
    """
    if not grid.down or {"dataset", "disturbance"} & set(grid.down):  # else scenarios would compete
        return cells
    places, told = _places(grid), "attitude" in grid.down
    groups = {
        key: group
        for key, group in grouped(grid.rows, metric).items()
        if _eligible(cells[places[key]]) and not (told and not attitude_competes(key[2]))
    }
    fields: dict[Values, list[Combination]] = {}
    for key in groups:
        fields.setdefault(places[key][: len(grid.across)], []).append(key)
    marked = dict(cells)
    for contest in contests(groups, fields.values(), rule, most):
        leaders = [places[key] for key in contest.leaders] if contest.decided else []
        for place in _whole(leaders, cells):
            marked[place] = dataclasses.replace(marked[place], best=True)
    return marked


def _places(grid: Grid) -> dict[Combination, Values]:
    """Return the place of each combination."""
    first = {place: runs[0] for place, runs in grid.runs.items()}
    factors = grid.rows[[*FACTORS]].to_numpy(dtype=str)
    return {tuple(map(str, factors[run])): place for place, run in first.items()}


def _eligible(cell: Cell) -> bool:
    return cell.replicate == "seed" and not cell.missing and not math.isnan(cell.mean)


def _whole(leaders: Sequence[Values], cells: Mapping[Values, Cell]) -> list[Values]:
    """Return those of the leaders that lost no runs, or all where each did."""
    return [place for place in leaders if cells[place].complete] or [*leaders]
