"""The sentences under a table: what is the same everywhere, how to read a cell, what went wrong."""

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from jerkbench.evaluation.statistics.intervals import FEW, MANY
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.analysis.references import standing_apart
from jerkbench.report.tables.table_model import ABSENT, GEOMETRIC, Cell, Table

if TYPE_CHECKING:
    import pandas as pd

RAISED = ", its level raised for few seeds (as Student's t is wider)"
"""What a reader has to know who compares with the plain bootstrap, such as scipy's."""

REASONS = 3
"""How many different reasons of failures are told."""

AT_THE_END = ("outage_end_m", "outage_end_max_m")
"""Metrics of which the number of outages is told."""


def footnotes(table: Table, rows: "pd.DataFrame", notes: Sequence[str], family: str = "") -> tuple[str, ...]:
    """Return the sentences under ``table``: of its tests as ``family`` says, the caller's ``notes`` at the end."""
    cells = [cell for row in table.cells for cell in row if cell is not None]
    return (*_constants(table), *_reading(table, cells, family), *_outages(table, rows), *_trouble(cells, rows), *notes)


def _constants(table: Table) -> Iterator[str]:
    if table.constants:
        yield "In every cell: " + ", ".join(f"{key} {value}" for key, value in table.constants) + "."


def _reading(table: Table, cells: list[Cell], family: str) -> Iterator[str]:
    """How to read the numbers."""
    yield from _intervals([c for c in cells if c.interval and c.replicate == "seed"], table.average)
    if any(c.interval for c in cells if c.replicate == "phase"):
        yield "{low–high}: range over the phases of one recording: not a confidence interval."  # noqa: RUF001 - a range
    if any(c.best for c in cells):
        lowest = f"Bold: the lowest {table.average} of the row among the cells whose runs all went well."
        yield f"{lowest} {standing_apart(_labels(table))}".strip()
    yield from _ratios(table, cells, family)
    what = quantity(table.metric)
    if what.expected is not None:
        yield f"A consistent filter gives {what.expected:g}; {what.reading}."
    if any(c.number == "n/a" for c in cells):
        yield "n/a: the metric does not apply."
    if any(cell is None for row in table.cells for cell in row):
        yield f"{ABSENT}: this combination was not run."


def _labels(table: Table) -> dict[str, set[str]]:
    """The labels of each factor."""
    columns, rows = (zip(*values, strict=True) for values in (table.columns, table.rows))
    of = zip((*table.column_keys, *table.row_keys), (*columns, *rows), strict=True)
    return {**{key: {value} for key, value in table.constants}, **{key: set(values) for key, values in of}}


def _intervals(cells: list[Cell], average: str) -> Iterator[str]:
    if not cells:
        return
    used = [cell.used for cell in cells]
    seeds = f"{max(used)}" if min(used) == max(used) else f"{min(used)} to {max(used)}"
    few = f" Of fewer than {FEW} seeds it is too short." if min(used) < FEW else ""
    bootstrap = min(used) < MANY
    kind, raised = ("BCa bootstrap", RAISED) if bootstrap else ("Student", "")
    yield f"[low, high]: 95 % {kind} interval of the {average} over {seeds} seeds{raised}.{few}"


def _ratios(table: Table, cells: list[Cell], family: str) -> Iterator[str]:
    """What the factors in the cells are, and what a star means."""
    baseline = ", ".join(f"{key}={value}" for key, value in table.baseline)
    if not any(c.factor for c in cells):
        if baseline:
            yield f"There is no ratio to {baseline}: no seed has a value above 0 in both."
        return
    yield f"×r: geometric mean of the ratio to {baseline} over the seeds that went well in both."  # noqa: RUF001
    if table.average != GEOMETRIC:
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


def _trouble(cells: list[Cell], rows: "pd.DataFrame") -> Iterator[str]:
    if any(c.diverged and not math.isnan(c.mean) for c in cells):
        yield "k/n diverged: k of n runs diverged; the mean is over the others."
    if any(c.missing and c.used for c in cells):
        bold = ", and never bold" if any(c.best for c in cells) else ""
        yield f"k/n n/a: k of n runs have no value of this metric; the mean is over the others{bold}."
    if any(c.failed for c in cells):
        reasons = list(dict.fromkeys(rows.loc[rows["status"] == "failed", "reason"].astype(str)))
        more = f"; and {len(reasons) - REASONS} more" if len(reasons) > REASONS else ""
        yield "Failed: " + "; ".join(reason.rstrip(".") for reason in reasons[:REASONS]) + more + "."
