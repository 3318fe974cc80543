"""Tables -> tidy CSV: one line a cell, all digits."""

import csv
import io
import math
from collections.abc import Sequence

from jerkbench.evaluation.statistics.intervals.share import share_interval
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.tables.table_model import Ratio, Table, TableCell

VALUES = (
    "average",
    "mean",
    "low",
    "high",
    "runs",
    "diverged",
    "failed",
    "missing",
    "replicate",
    "ratio",
    "ratio_low",
    "ratio_high",
    "p",
    "quartile_low",
    "quartile_high",
    "locked_out",
    "lost_share_low",
    "lost_share_high",
)
"""Columns after the metric, its unit and the factors; the ends are a range where ``replicate`` is "phase";
the ratio is empty without a baseline; ``average`` says what "mean" is: that, a geometric mean or a median; the ends of
the share of lost runs are those of Clopper and Pearson."""


FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""What a spreadsheet takes for the beginning of a formula."""

NO_RATIO = Ratio(math.nan, math.nan, math.nan, math.nan)


def tidy_csv(tables: Sequence[Table], *, header: bool = True) -> str:
    """Return a header and one line for each cell of the tables; a number that is not there is empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    if header:
        writer.writerow(["metric", "unit", *FACTORS, *VALUES])
    for table in tables:
        for row, cells in zip(table.rows, table.cells, strict=True):
            for column, cell in zip(table.columns, cells, strict=True):
                if cell is not None:
                    writer.writerow(
                        [inert(table.metric), inert(table.unit), *_factors(table, row, column), *_values(cell)]
                    )
    return text.getvalue()


def inert(text: str) -> str:
    """Return a text that a spreadsheet takes for text: an apostrophe stands before what would be a formula.

    >>> inert("=1+1")
    "'=1+1"
    """
    return f"'{text}" if text.startswith(FORMULA) and len(text) > 1 and not _is_number(text) else text


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _factors(table: Table, row: tuple[str, ...], column: tuple[str, ...]) -> list[str]:
    keys = (*table.row_keys, *table.column_keys)
    values = dict(table.constants) | dict(zip(keys, (*row, *column), strict=True))
    return [inert(values[key]) for key in FACTORS]


def _values(cell: TableCell) -> list[str]:
    counts = (cell.runs, cell.diverged, cell.failed, cell.missing)
    ratio = cell.ratio or NO_RATIO
    against = _written(ratio.value, ratio.low, ratio.high, ratio.p)
    share = _written(*share_interval(cell.diverged + cell.failed, cell.runs))
    spread = [*_written(*cell.quartiles), str(cell.locked), *share]
    centre = [cell.kind, *_written(cell.mean, cell.low, cell.high)]
    return [*centre, *map(str, counts), cell.replicate, *against, *spread]


def _written(*values: float) -> list[str]:
    return ["" if math.isnan(value) else repr(value) for value in values]
