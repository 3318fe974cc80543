"""A table as plain values: what every writer reads."""

import math
from dataclasses import dataclass

MEAN, GEOMETRIC = "mean", "geometric mean"


@dataclass(frozen=True)
class Ratio:
    """A cell's metric over that of the baseline, on the same seeds.

    Attributes:
        value: geometric mean; NaN where no seed went well in both.
        low: lower end of its 95 % interval (phases: the smallest).
        high: upper end.
        p: Wilcoxon's, corrected for the table by Holm; NaN where there is no test.
        shown: whether a difference was shown.
    """

    value: float
    low: float
    high: float
    p: float
    shown: bool

    @property
    def text(self) -> str:
        """The factor, with a star where a difference was shown; nothing without a pair."""
        if not math.isfinite(self.value):
            return ""
        return f"×{factor_number(self.value)}*" if self.shown else f"×{number(self.value)}"  # noqa: RUF001


@dataclass(frozen=True)
class Cell:
    """One combination with all its runs.

    Attributes:
        mean: over the runs that went well and have the metric; NaN without any.
        low: lower end of the interval (seeds), or the smallest value (phases); NaN where there is none.
        high: upper end, or the largest value.
        runs: all runs, also those that did not go well.
        diverged: how many of them diverged.
        failed: how many of them raised an error.
        missing: how many went well, but have no value of the metric (NaN).
        replicate: "seed" (independent draws) or "phase" (of one recording: not independent).
        best: whether no other cell of its row has a lower mean, as printed.
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
    best: bool = False
    ratio: Ratio | None = None

    @property
    def complete(self) -> bool:
        """Whether the mean is over all runs."""
        return self.used == self.runs and math.isfinite(self.mean)

    @property
    def used(self) -> int:
        """How many runs the mean is over."""
        return self.runs - self.diverged - self.failed - self.missing

    @property
    def text(self) -> str:
        """The cell as printed: mean, interval, and what went wrong."""
        parts = (self.number, self.interval, self.factor, self.trouble)
        return " ".join(part for part in parts if part)

    @property
    def number(self) -> str:
        """The mean, "n/a" where the metric does not apply, or nothing where no run went well."""
        if self.diverged + self.failed == self.runs:
            return ""
        return "n/a" if math.isnan(self.mean) else number(self.mean)

    @property
    def interval(self) -> str:
        """The interval in brackets, the range over phases in braces, or nothing."""
        if not (math.isfinite(self.low) and math.isfinite(self.high)):
            return ""
        low, high = number(self.low), number(self.high)
        return f"{{{low}–{high}}}" if self.replicate == "phase" else f"[{low}, {high}]"  # noqa: RUF001 - a range

    @property
    def factor(self) -> str:
        """The ratio to the baseline, or nothing."""
        return self.ratio.text if self.ratio else ""

    @property
    def trouble(self) -> str:
        """How many runs diverged, failed or have no value, or nothing; where none has one, "n/a" says that already."""
        counts = [("diverged", self.diverged), ("failed", self.failed), ("n/a", self.missing if self.used else 0)]
        if self.diverged + self.failed == self.runs:
            return ", ".join(f"{word} {n}/{self.runs}" for word, n in counts if n)
        said = ", ".join(f"{n}/{self.runs} {word}" for word, n in counts if n)
        return f"({said})" if said else ""


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
        average: what the numbers are: "mean", or "geometric mean".
    """

    title: str
    metric: str
    unit: str
    row_keys: tuple[str, ...]
    column_keys: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    columns: tuple[tuple[str, ...], ...]
    cells: tuple[tuple[Cell | None, ...], ...]
    constants: tuple[tuple[str, str], ...] = ()
    footnotes: tuple[str, ...] = ()
    baseline: tuple[tuple[str, str], ...] = ()
    average: str = MEAN

    @property
    def header(self) -> list[str]:
        """The row factors, then one text a column."""
        return [*self.row_keys, *(" / ".join(column) or self.average for column in self.columns)]

    @property
    def sparse_rows(self) -> list[list[str]]:
        """Values of `row_keys` without the leading ones that the line above has too."""
        lines, before = [], None
        for row in self.rows:
            same = 0
            while before is not None and same < len(row) - 1 and row[same] == before[same]:
                same += 1
            lines.append([*[""] * same, *row[same:]])
            before = row
        return lines


ABSENT = "–"  # noqa: RUF001 - the usual sign for a combination that does not exist


def number(value: float) -> str:
    """Write with three significant digits, all digits before the point, and no exponent where that reads well.

    >>> number(0.014), number(0.09996), number(140.2), number(4801.3), number(2.5e-6)
    ('0.0140', '0.100', '140', '4801', '2.50e-06')
    """
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    exponent = int(f"{value:.2e}".partition("e")[2])
    if not -4 <= exponent <= 5:
        return f"{value:.2e}"
    return f"{value:.{max(0, 2 - exponent)}f}"


def factor_number(value: float) -> str:
    """Write a ratio as `number` does, and one close to 1 with the digit that says on which side it is.

    >>> factor_number(0.5), factor_number(0.9982), factor_number(1.0004), factor_number(1.0)
    ('0.500', '0.998', '1.0004', '1.00')
    """
    text = number(value)
    if value == 1 or text != number(1.0):
        return text
    return f"{value:.{min(9, math.ceil(-math.log10(abs(value - 1))))}f}"
