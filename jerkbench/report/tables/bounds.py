"""The posterior Cramer-Rao bound of each scenario: a row below its filters that competes with none."""

import dataclasses
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.report.tables.table_model import Table, TableCell, number

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

Scenario = tuple[str, ...]


def with_bounds(table: Table, rows: "pd.DataFrame") -> Table:
    """Return ``table`` with a row for each scenario whose bound is known, where its rows are filters."""
    if table.metric != BOUNDED or "filter" not in table.row_keys or set(SCENARIO) & set(table.column_keys):
        return table
    bounds, lines = known_bounds(rows), list(zip(table.rows, table.cells, strict=True))
    scenarios = [_scenario(table, row) for row, _ in lines]
    for scenario, bound in bounds.items():
        if scenario in scenarios:
            at = len(scenarios) - scenarios[::-1].index(scenario)
            lines.insert(at, (_labels(table, scenario), (bound,) * len(table.columns)))
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


def known_bounds(rows: "pd.DataFrame") -> dict[Scenario, TableCell]:
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


def _scenario(table: Table, row: tuple[str, ...]) -> Scenario:
    values = dict(table.constants) | dict(zip(table.row_keys, row, strict=True))
    return tuple(values[key] for key in SCENARIO)


def _labels(table: Table, scenario: Scenario) -> tuple[str, ...]:
    values = dict(zip(SCENARIO, scenario, strict=True)) | {"filter": LABEL}
    return tuple(values.get(key, "") for key in table.row_keys)
