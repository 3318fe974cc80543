"""A table as plain values, which every writer reads; and the places of a study's runs in it."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, IntArray
from jerkbench.evaluation.over_seeds import (
    MEAN,
    MEDIAN,
    MIN_SEEDS,
    Samples,
    centres,
    mean_intervals,
    no_centres,
)
from jerkbench.report.columns import constants, layout, numbers_of_rows, quantity, with_text_factors

if TYPE_CHECKING:
    import pandas as pd

    from jerkbench.report.comparisons import Comparison


TextPart = tuple[str, str]
"""A text of a cell, and its style: number, best, interval, factor, trouble or absent."""


class TableCell(NamedTuple):
    """One combination with all its runs.

    Attributes:
        mean: what stands for the runs, as ``kind`` says; NaN without any, infinite where the median run was lost.
        low: lower end of the interval (seeds), or the smallest value (phases); NaN where there is none.
        high: upper end, or the largest value.
        runs: all runs, also those that did not go well.
        diverged: how many of them diverged.
        failed: how many of them raised an error.
        missing: how many went well, but have no value of the metric (NaN).
        replicate: "seed" (independent draws) or "phase" (of one recording: not independent).
        kind: "median" (over all runs, a lost one larger than every number), of fewer than six seeds, and of phases,
            "geometric mean" (over the runs that went well), or "mean" (of what is no error, over these).
        locked: how many went well, but are over ten times the median.
        quartiles: of the runs, as the median's.
        geometric: geometric mean of the runs that went well, beside a median; else NaN.
        own_interval: whether the interval is that of one recording; without ends it was too short to say.
        best: whether it belongs to the leaders of its row: others were shown to be worse, it was not.
        ratio: to the baseline, where one was chosen and this is not it.
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
    own_interval: bool = False
    best: bool = False
    ratio: "Comparison | None" = None

    @property
    def complete(self) -> bool:
        """Whether every run went well and has a value."""
        return self.used == self.runs and math.isfinite(self.mean)

    @property
    def used(self) -> int:
        """How many runs went well and have a value."""
        return self.runs - self.diverged - self.failed - self.missing

    @property
    def text(self) -> str:
        """The cell on one line: mean, interval, and what went wrong."""
        return " ".join(text for text, _ in parts(self))

    @property
    def number(self) -> str:
        """The centre, "n/a" where the metric does not apply, or nothing where no run went well."""
        if self.diverged + self.failed == self.runs:
            return ""
        return "n/a" if math.isnan(self.mean) else _or_lost(self.mean)

    @property
    def interval(self) -> str:
        """The interval in brackets, the range over phases without one in braces, or nothing."""
        if math.isnan(self.low) or math.isnan(self.high) or not self.used:
            return ""
        low, high = _or_lost(self.low), _or_lost(self.high)
        phases = self.replicate == "phase" and not self.own_interval
        return f"{{{low}–{high}}}" if phases else f"[{low}, {high}]"  # noqa: RUF001 - a range

    @property
    def beside(self) -> str:
        """The geometric mean of the runs that went well, beside a median."""
        return f"gm {number(self.geometric)}" if self.kind == MEDIAN and math.isfinite(self.geometric) else ""

    @property
    def factor(self) -> str:
        """The ratio to the baseline with its mark; the mark alone where the median run was lost."""
        if self.ratio is None:
            return ""
        return f"×{self.ratio.ratio_text}{self.ratio.mark}" if self.ratio.ratio_text else self.ratio.mark  # noqa: RUF001

    @property
    def trouble(self) -> str:
        """How many runs diverged, failed or have no value, or nothing; where none has one, "n/a" says that already."""
        counts = [("diverged", self.diverged), ("failed", self.failed), ("n/a", self.missing if self.used else 0)]
        if self.diverged + self.failed == self.runs:
            return ", ".join(f"{word} {n}/{self.runs}" for word, n in counts if n)
        words = [f"{n}/{self.runs} {word}" for word, n in (*counts, ("locked out", self.locked)) if n]
        return f"({', '.join(words)})" if words else ""


@dataclass(frozen=True)
class Table:
    """One metric over two sets of factors.

    Attributes:
        title: what it shows, with the unit.
        metric: column name of the metric.
        unit: unit of all numbers, "" for a ratio.
        row_keys: factors of the rows, such as ("filter",).
        column_keys: factors of the columns.
        rows: values of `row_keys`, one tuple a row.
        columns: values of `column_keys`, one tuple a column.
        cells: one tuple a row; None where the combination does not exist.
        constants: the other factors, each with its one value.
        footnotes: sentences that belong under it.
        baseline: factors and values of what the ratios are to; empty: there are none.
        average: what most of its numbers are.
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
        """Return it as Markdown."""
        from jerkbench.report.writers import markdown

        return markdown(self)

    def to_latex(self) -> str:
        """Return it as LaTeX, as `jerkbench table --format tex` prints it; the first line names the packages."""
        from jerkbench.report.writers import latex

        return latex(self)

    def _repr_html_(self) -> str:
        """Return it as a notebook shows it."""
        from jerkbench.report.writers import html_table

        return str(html_table(self))

    @property
    def header(self) -> list[str]:
        """The row factors, then one text a column."""
        return [*self.row_keys, *(" / ".join(column) or self.average for column in self.columns)]

    @property
    def sparse_rows(self) -> list[list[str]]:
        """Values of `row_keys` without the leading ones that the line above has too."""
        return [
            ["" if k + 1 < len(row) and row[: k + 1] == before[: k + 1] else value for k, value in enumerate(row)]
            for row, before in zip(self.rows, [(), *self.rows], strict=False)
        ]

    def placed(self) -> "Iterator[tuple[dict[str, str], TableCell]]":
        """Yield each cell that is there with the values of all factors."""
        keys, constants = (*self.row_keys, *self.column_keys), dict(self.constants)
        for row, cells in zip(self.rows, self.cells, strict=True):
            for column, cell in zip(self.columns, cells, strict=True):
                if cell is not None:
                    yield constants | dict(zip(keys, (*row, *column), strict=True)), cell


ABSENT = "–"  # noqa: RUF001 - the usual sign for a combination that does not exist


def parts(cell: TableCell | None) -> list[TextPart]:
    """Return what stands in a cell, in this order: number, interval, geometric mean, ratio, and what went wrong."""
    if cell is None:
        return [(ABSENT, "absent")]
    number = (cell.number, "best" if cell.best else "number")
    intervals = ((cell.interval, "interval"), (cell.beside, "interval"))
    told = (number, *intervals, (cell.factor, "factor"), (cell.trouble, "trouble"))
    return [part for part in told if part[0]]


def _or_lost(value: float) -> str:
    """Write a number; the median, or an end of its interval, may be a lost run."""
    return "lost" if value == math.inf else number(value)


def number(value: float) -> str:
    """Write with three significant digits, all digits before the point, and no exponent where that reads well.

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
    """Write a ratio as `number` does, and one close to 1 with the digit that says on which side it is.

    >>> factor_number(0.5), factor_number(0.9982), factor_number(1.0004), factor_number(1.0)
    ('0.500', '0.998', '1.0004', '1.00')
    """
    text = number(value)
    if value == 1 or text != number(1.0):
        return text
    return f"{value:.{min(9, math.ceil(-math.log10(abs(value - 1))))}f}"


# The places of a table with their runs, which the tables of all metrics share; their numbers in one metric.


OWN_INTERVAL = {"position_rmse_m": ("position_rmse_low_m", "position_rmse_high_m")}
"""Where the rows of one recording have the interval of a metric (metric one_recording)."""

Values = tuple[str, ...]
"""One value of each of some factors."""


@dataclass(frozen=True, eq=False)
class Grid:
    """The places of a table, and the runs of each.

    Attributes:
        rows: one row a run, the factors as text.
        across: factors of the table's rows.
        down: factors of its columns.
        row_values: the combinations of ``across``, grouped, values in the order in which they appear.
        column_values: those of ``down``.
        runs: for each combination of both, the numbers of its rows.
        order: the numbers of the rows of one place after those of the other.
        ok: whether each run went well, in this order.
        sizes: how many runs each place has.
        diverged: how many of them diverged.
        failed: how many of them failed.
        phases: whether they are phases of one recording, not seeds.
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
        """Return the values of a column, by place."""
        return Samples(self.rows[column].to_numpy(dtype=float)[self.order], self.sizes)

    def cells(self, metric: str) -> dict[Values, TableCell]:
        """Return the cell of each place."""
        return dict(zip(self.runs, self.each_cell(metric, range(len(self.runs))), strict=True))

    def in_order(self) -> list[int]:
        """Return the numbers of the places in the order of the table, row by row."""
        numbers = {place: k for k, place in enumerate(self.runs)}
        each = ((*row, *column) for row in self.row_values for column in self.column_values)
        return [numbers[place] for place in each if place in numbers]

    def each_cell(self, metric: str, places: Iterable[int]) -> Iterator[TableCell]:
        """Yield the cells of some places; of phases the interval is that of the recording, or their range.

        One at a time: the garbage collection goes through all that are kept, again and again.
        """
        values = self.samples(metric)
        good = values.only(self.ok)
        missing = good.count(np.isnan(good.values))
        # an error of which a geometric mean, or a median with losses at the top, makes sense
        if quantity(metric).lowest_is_best and not np.less(good.values, 0).any():
            least = np.where(self.phases, np.inf, MIN_SEEDS)
            errors = np.where(self.ok, values.values, np.inf)
            errors[(missing == good.sizes)[values.owner]] = np.nan  # without any value, failures are no error either
            averages = centres(Samples(errors, values.sizes), least=least)
        else:
            averages = no_centres(len(self.runs), MEAN)
            averages.value, averages.low, averages.high = mean_intervals(good)
        own = self.phases & (good.sizes > 0) & all(name in self.rows for name in OWN_INTERVAL.get(metric, ("",)))
        averages.low[self.phases] = averages.high[self.phases] = np.nan
        for where, of_phases in good.only(self.phases[good.owner]).without_nan().by_size():
            if of_phases.shape[1] > 1:  # one has no range
                averages.low[where], averages.high[where] = of_phases.min(axis=1), of_phases.max(axis=1)
        if own.any():
            for ends, name in zip((averages.low, averages.high), OWN_INTERVAL[metric], strict=True):
                with np.errstate(divide="ignore"):  # a filter that hands on its reference has no error
                    logs = Samples(np.log(self.samples(name).values), self.sizes).only(self.ok)
                for where, of_phases in logs.only(own[logs.owner]).by_size():
                    if of_phases.shape[1]:
                        ends[where] = np.exp(of_phases.mean(axis=1))
        counts = (self.sizes, self.diverged, self.failed, missing, self.phases, own)
        columns = [averages.tolist(), *(of.tolist() for of in counts)]
        for place in places:
            centre, runs, diverged, failed, absent, phase, owned = (of[place] for of in columns)
            kind, mean, low, high, lower, upper, geometric, locked = centre
            counted, quartiles = (runs, diverged, failed, absent, "phase" if phase else "seed"), (lower, upper)
            yield TableCell(mean, low, high, *counted, kind, locked, quartiles, geometric, owned)

    def table(self, metric: str, cells: Mapping[Values, TableCell]) -> Table:
        """Return a table of ``cells`` without footnotes."""
        lines = ((cells.get((*row, *column)) for column in self.column_values) for row in self.row_values)
        return Table(
            *(quantity(metric).heading, metric, quantity(metric).unit),
            row_keys=self.across,
            column_keys=self.down,
            rows=self.row_values,
            columns=self.column_values,
            cells=tuple(map(tuple, lines)),
            constants=constants(self.rows, (*self.across, *self.down)),
            average=Counter(cell.kind for cell in cells.values()).most_common(1)[0][0] if cells else MEAN,
        )


def arranged(rows: "pd.DataFrame", row_keys: Sequence[str] | None, column_keys: Sequence[str] | None) -> Grid:
    """Return the places of ``rows`` in a table of these factors.

    Raises:
        JerkbenchError: no such factor, or two rows of the same combination and seed.
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
    """Return each combination once, what has the first value in common together; values as they appear first."""
    combinations = list(dict.fromkeys(values))
    ranks = [{value: rank for rank, value in enumerate(dict.fromkeys(of))} for of in zip(*combinations, strict=True)]
    return tuple(
        sorted(
            combinations, key=lambda combination: [rank[value] for rank, value in zip(ranks, combination, strict=True)]
        )
    )
