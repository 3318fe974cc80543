"""Rows of runs -> one table."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.evaluation.statistics.intervals import mean_intervals
from jerkbench.report.comparison import Combination, Comparison, compare_to, family_note
from jerkbench.report.factors import FACTORS, constants, layout
from jerkbench.report.footnotes import footnotes
from jerkbench.report.quantities import quantity
from jerkbench.report.rows import checked, metric_columns
from jerkbench.report.table import Cell, Ratio, Table, number

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

    Raises:
        JerkbenchError: no such metric or factor, or two rows of the same combination and seed.
    """
    rows = checked(rows, metric)
    across, down = layout(rows, row_keys, column_keys)
    cells = _cells(rows, metric, [*across, *down])
    comparisons = compare_to(rows, metric, baseline) if baseline else []
    cells = _with_ratios(cells, comparisons, (*across, *down))
    row_values = _unique(rows, across)
    column_values = _unique(rows, down)
    what = quantity(metric)
    grid = [[cells.get((*row, *column)) for column in column_values] for row in row_values]
    if what.lowest_is_best:
        grid = [_with_best(row) for row in grid]
    table = Table(
        title=what.heading,
        metric=metric,
        unit=what.unit,
        row_keys=across,
        column_keys=down,
        rows=row_values,
        columns=column_values,
        cells=tuple(tuple(row) for row in grid),
        constants=constants(rows, (*across, *down)),
        baseline=tuple((baseline or {}).items()),
    )
    return dataclasses.replace(table, footnotes=footnotes(table, rows, notes, family_note(comparisons)))


def main_metric(rows: "pd.DataFrame") -> str:
    """Return the first of `LEADING` that has a value, else the first metric that has one, else `MAIN`."""
    valued = [column for column in metric_columns(rows) if rows.loc[rows["status"] == "ok", column].notna().any()]
    return next(iter([*(metric for metric in LEADING if metric in valued), *valued]), MAIN)


def _unique(rows: "pd.DataFrame", keys: tuple[str, ...]) -> tuple[tuple[str, ...], ...]:
    """Return the combinations of ``keys`` in the order in which they appear."""
    if not keys:
        return ((),)
    return tuple(rows[list(keys)].drop_duplicates().itertuples(index=False, name=None))


def _cells(rows: "pd.DataFrame", metric: str, keys: list[str]) -> dict[tuple[str, ...], Cell]:
    status, replicate = (rows[name].to_numpy(dtype=str) for name in ("status", "replicate"))
    values = rows[metric].to_numpy(dtype=float)
    groups = _groups(rows, keys)
    phases = [bool((replicate[group] == "phase").any()) for group in groups.values()]
    good = [values[group[status[group] == "ok"]] for group in groups.values()]
    intervals = mean_intervals([[] if phase else one for one, phase in zip(good, phases, strict=True)])
    cells = {}
    for (key, group), one, phase, interval in zip(groups.items(), good, phases, intervals, strict=True):
        ends = _range(one) if phase else (interval.mean, interval.low, interval.high)
        diverged, failed = (int((status[group] == name).sum()) for name in ("diverged", "failed"))
        missing = int(np.isnan(one).sum())
        cells[key] = Cell(*ends, len(group), diverged, failed, missing, "phase" if phase else "seed")
    return cells


def _with_ratios(
    cells: dict[Combination, Cell], comparisons: Sequence[Comparison], keys: tuple[str, ...]
) -> dict[Combination, Cell]:
    """Put each comparison into the cell of its subject."""
    compared = dict(cells)
    for one in comparisons:
        place = tuple(dict(zip(FACTORS, one.subject, strict=True))[key] for key in keys)
        paired = one.paired
        ratio = Ratio(paired.ratio, paired.low, paired.high, one.p, one.shown)
        compared[place] = dataclasses.replace(compared[place], ratio=ratio)
    return compared


def _groups(rows: "pd.DataFrame", keys: list[str]) -> dict[tuple[str, ...], IntArray]:
    """Return the row numbers of each combination of ``keys``."""
    groups: dict[tuple[str, ...], list[int]] = {}
    for number_of_row, key in enumerate(rows[keys].itertuples(index=False, name=None)):
        groups.setdefault(key, []).append(number_of_row)
    return {key: np.array(group) for key, group in groups.items()}


def _range(values: FloatArray) -> tuple[float, float, float]:
    """Return the mean, the smallest and the largest; one phase has no range."""
    known = values[~np.isnan(values)]
    if len(known) == 0:
        return np.nan, np.nan, np.nan
    low, high = (known.min(), known.max()) if len(known) > 1 else (np.nan, np.nan)
    return float(known.mean()), float(low), float(high)


def _with_best(row: list[Cell | None]) -> list[Cell | None]:
    """Mark the lowest mean, and what prints the same. A mean over the survivors of a divergence does not compete."""
    candidates = [cell for cell in row if cell is not None and cell.complete]
    if len(candidates) < 2:
        return row
    lowest = number(min(cell.mean for cell in candidates))
    return [
        dataclasses.replace(cell, best=True) if cell in candidates and cell and number(cell.mean) == lowest else cell
        for cell in row
    ]
