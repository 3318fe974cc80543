"""The footnotes of a table, and the posterior Cramer-Rao bound of each scenario, which competes with no filter."""

import dataclasses
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.evaluation.statistics.correlated_errors import LEAST_TIMES
from jerkbench.evaluation.statistics.errors_over_seeds import GEOMETRIC, MEAN, MEDIAN
from jerkbench.evaluation.statistics.intervals import ENOUGH, share_interval
from jerkbench.evaluation.statistics.over_seeds import LOCKED_OUT
from jerkbench.report.analysis.columns import quantity, standing_apart
from jerkbench.report.tables.table_model import ABSENT, Table, TableCell, number

if TYPE_CHECKING:
    import pandas as pd


BOUNDED, BOUND = "position_rmse_m", "position_bound_m"
"""The metric that has a bound, and the column with it."""

SCENARIO = ("dataset", "disturbance")
"""What a bound depends on; attitude and method do not enter."""

LABEL = "bound"
"""The filter's name in the row."""

TOLD = 6
"""Of how many scenarios the footnote gives the number."""

ToldScenario = tuple[str, ...]


def with_bounds(table: Table, rows: "pd.DataFrame") -> Table:
    """Return ``table`` with a row for each scenario whose bound is known, where its rows are filters."""
    if table.metric != BOUNDED or "filter" not in table.row_keys or set(SCENARIO) & set(table.column_keys):
        return table
    bounds, lines = known_bounds(rows), list(zip(table.rows, table.cells, strict=True))
    scenarios = [_scenario(table, row) for row, _ in lines]
    for scenario, bound in bounds.items():
        if scenario in scenarios:
            at = len(scenarios) - scenarios[::-1].index(scenario)
            labels_of = dict(zip(SCENARIO, scenario, strict=True)) | {"filter": LABEL}
            head = tuple(labels_of.get(key, "") for key in table.row_keys)
            lines.insert(at, (head, (bound,) * len(table.columns)))
            scenarios.insert(at, scenario)
    labels, cells = zip(*lines, strict=True) if lines else ((), ())
    return dataclasses.replace(table, rows=labels, cells=cells)


def bound_note(metric: str, rows: "pd.DataFrame") -> Iterator[str]:
    """Yield what the bound is, and of which scenarios none is known."""
    if metric != BOUNDED or BOUND not in rows.columns:
        return
    bounds = known_bounds(rows)
    count = len(rows[[*SCENARIO]].drop_duplicates())
    told = [f"{number(bound.mean)} ({', '.join(scenario)})" for scenario, bound in bounds.items()]
    more = [f"{len(told) - TOLD} more"] if len(told) > TOLD else []
    unknown = [f"not known for {count - len(told)} of {count} scenarios"] if len(told) < count else []
    yield (
        "Posterior Cramér-Rao bound, from the true noises: without hindsight, and with the motion unknown, no filter's"
        f" mean square is below it [m]: {', '.join([*told[:TOLD], *more, *unknown])}."
    )


def known_bounds(rows: "pd.DataFrame") -> dict[ToldScenario, TableCell]:
    """Return the root mean square over seeds of each scenario whose bound is known."""
    if BOUND not in rows.columns:
        return {}
    known = rows[np.isfinite(rows[BOUND].to_numpy(dtype=float)) & (rows["status"] == "ok").to_numpy()]
    bounds = {}
    for scenario, of in known.groupby([*SCENARIO], sort=False):
        seeds = of.groupby("seed")[BOUND].min().to_numpy()
        cell = TableCell(float(np.sqrt(np.mean(seeds**2))), math.nan, math.nan, len(seeds))
        bounds[tuple(map(str, scenario))] = cell
    return bounds


def _scenario(table: Table, row: tuple[str, ...]) -> ToldScenario:
    values = dict(table.constants) | dict(zip(table.row_keys, row, strict=True))
    return tuple(values[key] for key in SCENARIO)


# The sentences under a table: what is the same everywhere, how to read a cell, what went wrong.

REASONS = 3
"""How many different reasons of failures are told."""

KINDS = {
    GEOMETRIC: "Geometric mean [low, high] of the runs that went well: Student's 95 % interval of the logarithms over "
    "{seeds} seeds.",
    MEDIAN: "Median [low, high]: of all {seeds} seeds, a lost run larger than every number; 95 % by order statistics. "
    "gm: geometric mean of the runs that went well.",
    MEAN: "Mean [low, high]: 95 % BCa bootstrap interval over {seeds} seeds, of fewer than 5 Student's.",
}
"""What stands in a cell."""

FEW = f" Of fewer than {ENOUGH} it is widened for skewed errors."
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
            f"1/{LEAST_TIMES} of it."
        )


def _labels(table: Table) -> dict[str, set[str]]:
    """The labels of each factor."""
    columns, rows = (zip(*values, strict=True) for values in (table.columns, table.rows))
    of = zip((*table.column_keys, *table.row_keys), (*columns, *rows), strict=True)
    return {**{key: {value} for key, value in table.constants}, **{key: set(values) for key, values in of}}


def _intervals(cells: list[TableCell]) -> Iterator[str]:
    """What the brackets are, for each kind of centre."""
    for kind, words in KINDS.items():
        used = [cell.runs if kind == MEDIAN else cell.used for cell in cells if cell.kind == kind]
        if used:
            seeds = f"{max(used)}" if min(used) == max(used) else f"{min(used)} to {max(used)}"
            few = kind == GEOMETRIC and min(used) < ENOUGH
            yield words.format(seeds=seeds) + (FEW if few else "")


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
        yield f"k/n locked out: k of n runs are over {LOCKED_OUT:g} times the median."
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
