"""The lines of table.csv for many metrics of one grid: what they share is written once, no cell becomes an object."""

import csv
import io
from functools import cache, cached_property

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.evaluation.statistics.intervals.share import share_interval
from jerkbench.plain import plain
from jerkbench.report.analysis.factors import FACTORS, constants
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.tables.cell_columns import CellColumns
from jerkbench.report.tables.csv import inert
from jerkbench.report.tables.grid import Grid

NO_RATIO = ",,,"
"""Four columns without a baseline."""


class GridCsv:
    """The places of a grid as lines of `tidy_csv`, in the order of its table."""

    def __init__(self, grid: Grid) -> None:
        """Take the grid of all metrics."""
        self.grid = grid

    def lines(self, metric: str, numbers: CellColumns) -> str:
        """Return one line for each place."""
        head, of, order = f"{escaped(metric)},{escaped(quantity(metric).unit)}", numbers.centres, self._order
        columns = (
            self._factors,
            of.kind[order].tolist(),
            *(texts(values[order]) for values in (of.value, of.low, of.high)),
            self._counts,
            numbers.missing[order].tolist(),
            self._replicates,
            *(texts(values[order]) for values in (of.lower_quartile, of.upper_quartile)),
            of.locked[order].tolist(),
            self._shares,
        )
        return "".join(
            f"{head},{factors},{kind},{mean},{low},{high},{counts},{missing},{replicate},{NO_RATIO},{lower},{upper},{locked},{share}\n"
            for factors, kind, mean, low, high, counts, missing, replicate, lower, upper, locked, share in zip(
                *columns, strict=True
            )
        )

    @cached_property
    def _order(self) -> IntArray:
        place = {key: number for number, key in enumerate(self.grid.runs)}
        keys = ((*row, *column) for row in self.grid.row_values for column in self.grid.column_values)
        return np.array([place[key] for key in keys if key in place], dtype=np.int64)

    @cached_property
    def _factors(self) -> list[str]:
        grid = self.grid
        names = (*grid.across, *grid.down)
        values = dict(constants(grid.rows, names))
        keys = list(grid.runs)
        known = (values | dict(zip(names, keys[place], strict=True)) for place in self._order.tolist())
        return [",".join(escaped(own[factor]) for factor in FACTORS) for own in known]

    @cached_property
    def _counts(self) -> list[str]:
        grid = self.grid
        counts = (of[self._order].tolist() for of in (grid.sizes, grid.diverged, grid.failed))
        return [",".join(map(str, own)) for own in zip(*counts, strict=True)]

    @cached_property
    def _replicates(self) -> list[str]:
        words: list[str] = np.where(self.grid.phases[self._order], "phase", "seed").tolist()
        return words

    @cached_property
    def _shares(self) -> list[str]:
        lost = (self.grid.diverged + self.grid.failed)[self._order].tolist()
        runs = self.grid.sizes[self._order].tolist()
        return [",".join(map(repr, share_interval(*counts))) for counts in zip(lost, runs, strict=True)]


def texts(values: FloatArray) -> list[str]:
    """Return all digits of each number; nothing of what is none."""
    written = list(map(repr, values.tolist()))
    for place in np.flatnonzero(np.isnan(values)).tolist():
        written[place] = ""
    return written


@cache
def escaped(text: str) -> str:
    """Return a text as it stands in a line, which a spreadsheet takes for text."""
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow([plain(inert(text)), ""])
    return line.getvalue()[:-2]
