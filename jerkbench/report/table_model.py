"""The data model of tables, from which all output formats are written, and the assignment of runs to table cells."""

import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, IntArray
from jerkbench.evaluation.intervals import (
    MEAN,
    MEDIAN,
    MIN_SEEDS,
    Samples,
    centres,
    mean_intervals,
    no_centres,
)
from jerkbench.report.columns import FACTORS, MAIN, layout, numbers_of_rows, quantity, with_text_factors

if TYPE_CHECKING:
    import pandas as pd

    from jerkbench.report.comparisons import Comparison


TextPart = tuple[str, str]
"""A part of the text of a cell, and its style: number, best, interval, factor, trouble or absent."""


class TableCell(NamedTuple):
    """The results of one combination, averaged over all its runs.

    Attributes:
        mean: average of the runs (see ``kind``), NaN if no run has a value, and infinite if the median run failed.
        low: lower end of the 95 % interval of the average (for phases, the smallest value), NaN if unknown.
        high: upper end of the 95 % interval of the average (for phases, the largest value), NaN if unknown.
        runs: number of all runs, including diverged and failed runs.
        diverged: number of runs that diverged.
        failed: number of runs that raised an error.
        missing: number of successful runs without a value of the metric (NaN).
        replicate: "seed" if the runs are independent, or "phase" if they are phases of one recording.
        kind: kind of the average: "median", "geometric mean" or "mean". The median includes failed runs as infinite
            values. The geometric mean of the successful runs is used for fewer than six seeds and for phases. The mean
            of the successful runs is used for metrics that are not errors.
        locked: number of successful runs whose error is more than ten times the median error of the combination.
        quartiles: lower and upper quartile of the metric over the runs, NaN if no run has a value.
        geometric: geometric mean of the successful runs, NaN if unknown.
        recording_interval: whether ``low`` and ``high`` were estimated from a single recording by the metric
            one_recording. If the recording is too short, ``low`` and ``high`` are NaN.
        best: whether the combination is one of the best in its row of the table.
        ratio: comparison with the baseline, or None for a table without a baseline and for the baseline itself.
    """

    mean: float
    low: float
    high: float
    runs: int
    diverged: int = 0
    failed: int = 0
    missing: int = 0
    replicate: str = "seed"
    kind: str = MEAN
    locked: int = 0
    quartiles: tuple[float, float] = (math.nan, math.nan)
    geometric: float = math.nan
    recording_interval: bool = False
    best: bool = False
    ratio: "Comparison | None" = None

    @property
    def complete(self) -> bool:
        """True if every run succeeded and has a value of the metric."""
        return self.used == self.runs and math.isfinite(self.mean)

    @property
    def used(self) -> int:
        """The number of successful runs that have a value of the metric."""
        return self.runs - self.diverged - self.failed - self.missing

    @property
    def text(self) -> str:
        """The text of the cell on one line: the texts that `parts` returns, joined by spaces."""
        return " ".join(text for text, _ in parts(self))

    @property
    def number(self) -> str:
        """Text with the average, "n/a" if the metric does not apply, or an empty text if no run succeeded."""
        if self.diverged + self.failed == self.runs:
            return ""
        return "n/a" if math.isnan(self.mean) else _number_or_failed(self.mean)

    @property
    def interval(self) -> str:
        """Text with the interval in brackets, or with the range over phases in braces, or an empty text if unknown."""
        if math.isnan(self.low) or math.isnan(self.high) or not self.used:
            return ""
        low, high = _number_or_failed(self.low), _number_or_failed(self.high)
        phases = self.replicate == "phase" and not self.recording_interval
        return f"{{{low}–{high}}}" if phases else f"[{low}, {high}]"  # noqa: RUF001 - a range

    @property
    def geometric_text(self) -> str:
        """Text with the geometric mean of the successful runs, or an empty text in a cell without a median."""
        return f"gm {number(self.geometric)}" if self.kind == MEDIAN and math.isfinite(self.geometric) else ""

    @property
    def factor(self) -> str:
        """Text with the ratio to the baseline and the mark of the verdict, or only the mark without a ratio."""
        if self.ratio is None:
            return ""
        return f"×{self.ratio.ratio_text}{self.ratio.mark}" if self.ratio.ratio_text else self.ratio.mark  # noqa: RUF001

    @property
    def trouble(self) -> str:
        """Text with the numbers of runs that diverged, failed, have no value, or are outliers ("locked out").

        Numbers that are 0 are left out.
        """
        counts = [("diverged", self.diverged), ("failed", self.failed), ("n/a", self.missing if self.used else 0)]
        if self.diverged + self.failed == self.runs:
            return ", ".join(f"{name} {n}/{self.runs}" for name, n in counts if n)
        texts = [f"{n}/{self.runs} {name}" for name, n in (*counts, ("locked out", self.locked)) if n]
        return f"({', '.join(texts)})" if texts else ""


@dataclass(frozen=True)
class Table:
    """The table of one metric. Some factors of the study define the rows, and other factors define the columns.

    Attributes:
        title: title of the table, which contains the unit.
        metric: column name of the metric.
        unit: unit of all numbers in the cells, or an empty text for a dimensionless metric.
        row_keys: factors that define the rows, such as ("filter",).
        column_keys: factors that define the columns, such as ("adaptation",).
        rows: labels of each row, as a tuple with one value for each factor in ``row_keys``.
        columns: labels of each column, as a tuple with one value for each factor in ``column_keys``.
        cells: one tuple of cells for each row. A cell is None if its combination was not run.
        constants: pairs of a factor that defines neither rows nor columns, and the constant value of this factor.
        footnotes: footnotes below the table.
        baseline: factors and values of the baseline to which ratios are computed, empty for a table without ratios.
        average: most frequent kind of average in the cells, for example "median".
    """

    title: str
    metric: str
    unit: str
    row_keys: tuple[str, ...]
    column_keys: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    columns: tuple[tuple[str, ...], ...]
    cells: tuple[tuple[TableCell | None, ...], ...]
    constants: tuple[tuple[str, str], ...] = ()
    footnotes: tuple[str, ...] = ()
    baseline: tuple[tuple[str, str], ...] = ()
    average: str = MEAN

    def __str__(self) -> str:
        from jerkbench.report.writers import markdown

        return markdown(self)

    def to_latex(self) -> str:
        """Return the table as LaTeX, as `jerkbench table --format tex` does.

        The first line is a comment with the required packages.
        """
        from jerkbench.report.writers import latex

        return latex(self)

    def _repr_html_(self) -> str:
        from jerkbench.report.writers import html_table

        return str(html_table(self))

    @property
    def header(self) -> list[str]:
        """The names of the row factors, followed by the header of each column."""
        return [*self.row_keys, *(" / ".join(column) or self.average for column in self.columns)]

    @property
    def sparse_rows(self) -> list[list[str]]:
        """The labels of each row. Leading labels that repeat the row above are replaced by empty texts."""
        return [
            ["" if k + 1 < len(row) and row[: k + 1] == before[: k + 1] else value for k, value in enumerate(row)]
            for row, before in zip(self.rows, [(), *self.rows], strict=False)
        ]

    def placed(self) -> "Iterator[tuple[dict[str, str], TableCell]]":
        """For each combination that was run, yield the labels of all factors and the cell."""
        keys, constants = (*self.row_keys, *self.column_keys), dict(self.constants)
        for row, cells in zip(self.rows, self.cells, strict=True):
            for column, cell in zip(self.columns, cells, strict=True):
                if cell is not None:
                    yield constants | dict(zip(keys, (*row, *column), strict=True)), cell


ABSENT = "–"  # noqa: RUF001 - the usual sign for a combination that does not exist


def parts(cell: TableCell | None) -> list[TextPart]:
    """Return the non-empty texts of a cell with their styles: number, interval, geometric mean, ratio, failures."""
    if cell is None:
        return [(ABSENT, "absent")]
    number = (cell.number, "best" if cell.best else "number")
    intervals = ((cell.interval, "interval"), (cell.geometric_text, "interval"))
    texts = (number, *intervals, (cell.factor, "factor"), (cell.trouble, "trouble"))
    return [part for part in texts if part[0]]


def _number_or_failed(value: float) -> str:
    """Return text with a number. For infinity, which represents a failed run, the text is "failed"."""
    return "failed" if value == math.inf else number(value)


def number(value: float) -> str:
    """Return the text of a number with three significant digits and all digits before the decimal point.

    >>> number(0.014), number(0.09996), number(140.2), number(4801.3), number(2.5e-6)
    ('0.0140', '0.100', '140', '4801', '2.50e-06')
    """
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    text = f"{value:#.3g}"
    if "e" in text:
        return f"{value:.0f}" if 999 < abs(value) < 999_500 else f"{value:.2e}"
    return text.removesuffix(".")


def factor_number(value: float) -> str:
    """Return the text of a ratio in the format of `number`. A ratio close to 1 has enough digits to differ from 1.

    >>> factor_number(0.5), factor_number(0.9982), factor_number(1.0004), factor_number(1.0)
    ('0.500', '0.998', '1.0004', '1.00')
    """
    text = number(value)
    if value == 1 or text != number(1.0):
        return text
    return f"{value:.{min(9, math.ceil(-math.log10(abs(value - 1))))}f}"


def range_text(values: Collection[float]) -> str:
    """Return text with the smallest and the largest value, or one number if all values are equal.

    >>> range_text([20, 8, 20]), range_text([8, 8])
    ('8 to 20', '8')
    """
    low, high = min(values), max(values)
    return f"{low}" if low == high else f"{low} to {high}"


def first_of(texts: Sequence[str], maximum: int, separator: str = ", ") -> str:
    """Return the first ``maximum`` texts, and the number of the other texts.

    >>> first_of(["a", "b", "c"], 2)
    'a, b and 1 more'
    """
    more = f" and {len(texts) - maximum} more" if len(texts) > maximum else ""
    return separator.join(texts[:maximum]) + more


# The grid assigns runs to the cells of a table. All metrics of a study use the same grid.


RECORDING_INTERVAL = {MAIN: ("position_rmse_low_m", "position_rmse_high_m")}
"""For each metric, the columns with its interval from a single recording (metric one_recording)."""

Values = tuple[str, ...]
"""Values of several factors of a combination."""


@dataclass(frozen=True, eq=False)
class Grid:
    """The assignment of runs to the cells of a table.

    Attributes:
        rows: one row for each run. The columns of the factors must contain text.
        across: factors that define the rows of the table.
        down: factors that define the columns of the table.
        row_values: for each row of the table, the labels of the factors in ``across``.
        column_values: for each column of the table, the labels of the factors in ``down``.
        runs: for each cell, the row numbers of its runs in ``rows``. A key contains the labels of the factors in
            ``across`` and ``down``.
        order: row numbers of all runs in ``rows``, sorted by cell.
        ok: (runs,) whether each run succeeded, in the order of ``order``.
        sizes: number of runs of each cell.
        diverged: number of diverged runs of each cell.
        failed: number of failed runs of each cell.
        phases: for each cell, whether its runs are phases of one recording instead of seeds.
    """

    rows: "pd.DataFrame"
    across: tuple[str, ...]
    down: tuple[str, ...]
    row_values: tuple[Values, ...]
    column_values: tuple[Values, ...]
    runs: dict[Values, IntArray]
    order: IntArray
    ok: BoolArray
    sizes: IntArray
    diverged: IntArray
    failed: IntArray
    phases: BoolArray

    def samples(self, column: str) -> Samples:
        """Return the values of a column of ``rows``, divided into one sample for each cell."""
        return Samples(self.rows[column].to_numpy(dtype=float)[self.order], self.sizes)

    def cells(self, metric: str) -> dict[Values, TableCell]:
        """Return all cells of a table, with the averages of one metric.

        For phases, the interval of the recording is used if the metric one_recording computed it, otherwise the range
        of the values.
        """
        values = self.samples(metric)
        good = values.only(self.ok)
        missing = good.count(np.isnan(good.values))
        # Geometric means, and medians in which failures count as infinite, are meaningful only for errors.
        if quantity(metric).lowest_is_best and not np.less(good.values, 0).any():
            least = np.where(self.phases, np.inf, MIN_SEEDS)
            errors = np.where(self.ok, values.values, np.inf)
            errors[(missing == good.sizes)[values.owner]] = np.nan  # the metric does not apply if no run has a value
            averages = centres(Samples(errors, values.sizes), least=least)
        else:
            averages = no_centres(len(self.runs), MEAN)
            averages.value, averages.low, averages.high = mean_intervals(good)
        recorded = all(name in self.rows for name in RECORDING_INTERVAL.get(metric, ("",)))
        with_interval = self.phases & (good.sizes > 0) & recorded
        averages.low[self.phases] = averages.high[self.phases] = np.nan
        for where, of_phases in good.only(self.phases[good.owner]).without_nan().by_size():
            if of_phases.shape[1] > 1:  # a single phase has no range
                averages.low[where], averages.high[where] = of_phases.min(axis=1), of_phases.max(axis=1)
        if with_interval.any():
            for ends, name in zip((averages.low, averages.high), RECORDING_INTERVAL[metric], strict=True):
                with np.errstate(divide="ignore"):  # a filter that returns the reference has an error of 0
                    logs = Samples(np.log(self.samples(name).values), self.sizes).only(self.ok)
                for where, of_phases in logs.only(with_interval[logs.owner]).by_size():
                    if of_phases.shape[1]:
                        ends[where] = np.exp(of_phases.mean(axis=1))
        columns = (averages, self.sizes, self.diverged, self.failed, missing, self.phases, with_interval)
        cells = {}
        for position, centre, *numbers in zip(self.runs, *(column.tolist() for column in columns), strict=True):
            kind, mean, low, high, lower, upper, geometric, locked = centre
            runs, diverged, failed, absent, phase, owned = numbers
            counted, quartiles = (runs, diverged, failed, absent, "phase" if phase else "seed"), (lower, upper)
            cells[position] = TableCell(mean, low, high, *counted, kind, locked, quartiles, geometric, owned)
        return cells

    def table(self, metric: str, cells: Mapping[Values, TableCell]) -> Table:
        """Return the table of a metric with the given ``cells``. The table has no footnotes yet."""
        lines = ((cells.get((*row, *column)) for column in self.column_values) for row in self.row_values)
        constants = ((key, self.rows[key].iloc[0]) for key in FACTORS if key not in (*self.across, *self.down))
        return Table(
            *(quantity(metric).heading, metric, quantity(metric).unit),
            row_keys=self.across,
            column_keys=self.down,
            rows=self.row_values,
            columns=self.column_values,
            cells=tuple(map(tuple, lines)),
            constants=tuple(constants) if len(self.rows) else (),
            average=Counter(cell.kind for cell in cells.values()).most_common(1)[0][0] if cells else MEAN,
        )


def arranged(rows: "pd.DataFrame", row_keys: Sequence[str] | None, column_keys: Sequence[str] | None) -> Grid:
    """Return the grid of a table with the given factors. For factors that are None, `layout` selects the factors.

    Raises:
        JerkbenchError: a factor is unknown, or two rows have the same combination and seed.
    """
    rows = with_text_factors(rows)
    across, down = layout(rows, row_keys, column_keys)
    runs = numbers_of_rows(rows, [*across, *down])
    row_values = _grouped(key[: len(across)] for key in runs) if across else ((),)
    column_values = _grouped(key[len(across) :] for key in runs) if down else ((),)
    order = np.concatenate([np.empty(0, np.int64), *runs.values()])
    samples = Samples(np.zeros(len(order)), np.array([len(of) for of in runs.values()], dtype=np.int64))
    status, replicate = (rows[name].to_numpy(dtype=str)[order] for name in ("status", "replicate"))
    diverged, failed, phases = map(samples.count, (status == "diverged", status == "failed", replicate == "phase"))
    found = across, down, row_values, column_values, runs, order, status == "ok", samples.sizes
    return Grid(rows, *found, diverged, failed, phases > 0)


def _grouped(values: Iterable[Values]) -> tuple[Values, ...]:
    """Return the distinct combinations of labels, sorted by the first appearance of each label."""
    found = list(dict.fromkeys(values))
    ranks = [{value: rank for rank, value in enumerate(dict.fromkeys(of))} for of in zip(*found, strict=True)]
    return tuple(sorted(found, key=lambda one: [rank[value] for rank, value in zip(ranks, one, strict=True)]))
