"""Rows of runs -> one table."""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.intervals import mean_intervals
from jerkbench.report.analysis.comparison import Comparison, compare_to, family_note
from jerkbench.report.analysis.factors import FACTORS, constants
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.analysis.references import attitude_competes, competes
from jerkbench.report.analysis.rows import metric_columns, with_metric
from jerkbench.report.tables.footnotes import footnotes
from jerkbench.report.tables.grid import Grid, Values, arranged
from jerkbench.report.tables.table_model import GEOMETRIC, MEAN, Cell, Ratio, Table, number

if TYPE_CHECKING:
    import pandas as pd

MAIN = "position_rmse_m"
"""The metric of a table for which none is asked."""


LEADING = (MAIN, "inclination_rmse_deg", "anis_per_row")
"""What leads a study for which it was computed; the second of attitude alone, the third without a reference."""


def summarise(
    rows: "pd.DataFrame",
    metric: str,
    row_keys: Sequence[str] | None = None,
    column_keys: Sequence[str] | None = None,
    notes: Sequence[str] = (),
    baseline: Mapping[str, str] | None = None,
    *,
    geometric: bool = False,
) -> Table:
    """Return the table of one metric.

    Args:
        rows: one row a cell and seed: the six factors, seed, replicate ("seed" or "phase"), status ("ok", "diverged",
            "failed"), reason, and the metrics.
        metric: which metric's column.
        row_keys: factors of the rows; without them, all that vary and are not columns.
        column_keys: factors of the columns; without them the adaptation.
        notes: sentences to put under the table, such as which combinations were left out and why.
        baseline: values of factors; each cell then has its ratio to the cell that is like it but for these, and its
            mean is geometric, as the ratio is.
        geometric: whether the means are geometric without a baseline too. Those of values that are not positive, of
            which there is none, are arithmetic.

    Raises:
        JerkbenchError: no such metric or factor, or two rows of the same combination and seed.
    """
    rows = with_metric(rows, metric)
    return _table(arranged(rows, row_keys, column_keys), metric, notes, baseline or {}, geometric=geometric)


def summarise_each(
    rows: "pd.DataFrame",
    metrics: Iterable[str],
    row_keys: Sequence[str] | None = None,
    column_keys: Sequence[str] | None = None,
) -> dict[str, Table]:
    """Return the tables of several metrics: `summarise` of each, with what they share done once."""
    grid = arranged(rows, row_keys, column_keys)
    return {metric: _table(grid, metric, (), {}) for metric in metrics}


def main_metric(rows: "pd.DataFrame") -> str:
    """Return the first of `LEADING` that has a value, else the first metric that has one, else `MAIN`."""
    valued = [column for column in metric_columns(rows) if rows.loc[rows["status"] == "ok", column].notna().any()]
    return next(iter([*(metric for metric in LEADING if metric in valued), *valued]), MAIN)


def _table(
    grid: Grid, metric: str, notes: Sequence[str], baseline: Mapping[str, str], *, geometric: bool = False
) -> Table:
    comparisons = compare_to(grid.rows, metric, baseline) if baseline else []
    geometric = (geometric or bool(baseline)) and _positive(grid, metric)
    cells = _with_ratios(_cells(grid, metric, geometric=geometric), comparisons, (*grid.across, *grid.down))
    lines = [[cells.get((*row, *column)) for column in grid.column_values] for row in grid.row_values]
    what = quantity(metric)
    if what.lowest_is_best and not {"dataset", "disturbance"} & set(grid.down):  # else scenarios would compete
        lines = [_with_best(line, _rivals(grid, row)) for line, row in zip(lines, grid.row_values, strict=True)]
    table = Table(
        title=dataclasses.replace(what, title=f"{what.title}, {GEOMETRIC}").heading if geometric else what.heading,
        metric=metric,
        unit=what.unit,
        row_keys=grid.across,
        column_keys=grid.down,
        rows=grid.row_values,
        columns=grid.column_values,
        cells=tuple(tuple(line) for line in lines),
        constants=constants(grid.rows, (*grid.across, *grid.down)),
        baseline=tuple(baseline.items()),
        average=GEOMETRIC if geometric else MEAN,
    )
    return dataclasses.replace(table, footnotes=footnotes(table, grid.rows, notes, family_note(comparisons)))


def _positive(grid: Grid, metric: str) -> bool:
    """Whether the mean of the logarithms says something: every value has one, and no arithmetic mean is expected."""
    if quantity(metric).expected is not None:
        return False
    values = grid.rows[metric].to_numpy(dtype=float)[grid.status == "ok"]
    return bool((values[~np.isnan(values)] > 0).all())


def _cells(grid: Grid, metric: str, *, geometric: bool) -> dict[Values, Cell]:
    values = grid.rows[metric].to_numpy(dtype=float)
    if geometric:
        values = np.log(np.where(grid.status == "ok", values, np.nan))
    phases = [bool(grid.phase[runs].any()) for runs in grid.runs.values()]
    good = [values[runs[grid.status[runs] == "ok"]] for runs in grid.runs.values()]
    intervals = mean_intervals([[] if phase else one for one, phase in zip(good, phases, strict=True)])
    cells = {}
    for (key, runs), one, phase, interval in zip(grid.runs.items(), good, phases, intervals, strict=True):
        ends = _range(one) if phase else (interval.mean, interval.low, interval.high)
        ends = _exponentials(ends) if geometric else ends
        diverged, failed = (int((grid.status[runs] == name).sum()) for name in ("diverged", "failed"))
        missing = int(np.isnan(one).sum())
        cells[key] = Cell(*ends, len(runs), diverged, failed, missing, "phase" if phase else "seed")
    return cells


def _exponentials(logarithms: tuple[float, float, float]) -> tuple[float, float, float]:
    with np.errstate(over="ignore"):  # of two seeds far apart an end may be beyond all numbers
        mean, low, high = np.exp(logarithms)
    return float(mean), float(low), float(high)


def _with_ratios(
    cells: dict[Values, Cell], comparisons: Sequence[Comparison], keys: tuple[str, ...]
) -> dict[Values, Cell]:
    """Put each comparison into the cell of its subject."""
    compared = dict(cells)
    for one in comparisons:
        place = tuple(dict(zip(FACTORS, one.subject, strict=True))[key] for key in keys)
        paired = one.paired
        ratio = Ratio(paired.ratio, paired.low, paired.high, one.p, one.shown)
        compared[place] = dataclasses.replace(compared[place], ratio=ratio)
    return compared


def _range(values: FloatArray) -> tuple[float, float, float]:
    """Return the mean, the smallest and the largest; one phase has no range."""
    known = values[~np.isnan(values)]
    if len(known) == 0:
        return np.nan, np.nan, np.nan
    low, high = (known.min(), known.max()) if len(known) > 1 else (np.nan, np.nan)
    return float(known.mean()), float(low), float(high)


def _rivals(grid: Grid, row: Values) -> list[bool]:
    """Which cells of a row compete: no references, and none where the cells have different seeds."""
    runs = [grid.runs.get((*row, *column)) for column in grid.column_values]
    drawn = {tuple(sorted(grid.rows["seed"].to_numpy()[one])) for one in runs if one is not None}
    labels = [dict(zip((*grid.across, *grid.down), (*row, *column), strict=True)) for column in grid.column_values]
    fixed = dict(constants(grid.rows, (*grid.across, *grid.down)))
    return [
        len(drawn) == 1
        and competes({**fixed, **own})
        and ("attitude" not in grid.down or attitude_competes(own["attitude"]))
        for own in labels
    ]


def _with_best(row: list[Cell | None], competing: Sequence[bool]) -> list[Cell | None]:
    """Mark the lowest mean, and what prints the same. A mean over the survivors of a divergence does not compete."""
    candidates = [cell for cell, one in zip(row, competing, strict=True) if one and cell is not None and cell.complete]
    if len(candidates) < 2:
        return row
    lowest = number(min(cell.mean for cell in candidates))
    return [
        dataclasses.replace(cell, best=True) if cell and one and cell.complete and number(cell.mean) == lowest else cell
        for cell, one in zip(row, competing, strict=True)
    ]
