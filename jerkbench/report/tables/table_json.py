"""A table -> JSON: each cell with its factors, all digits, and the sentences below it."""

import json
import math
from typing import Any

from jerkbench.report.tables.table_model import Ratio, Table, TableCell

LOST = "lost"
"""In the place of a number that is larger than every number: the median run was lost."""


def table_json(table: Table) -> str:
    """Return the table as JSON; what is no number is null, a median that is a lost run "lost"."""
    head = {name: getattr(table, name) for name in ("title", "metric", "unit", "row_keys", "column_keys")}
    content = {
        **head,
        "baseline": dict(table.baseline),
        "cells": list(_cells(table)),
        "footnotes": table.footnotes,
    }
    return json.dumps(content, indent=2, allow_nan=False) + "\n"


def _cells(table: Table) -> "list[dict[str, Any]]":
    keys = (*table.row_keys, *table.column_keys)
    return [
        {"combination": dict(table.constants) | dict(zip(keys, (*row, *column), strict=True)), **_values(cell)}
        for row, cells in zip(table.rows, table.cells, strict=True)
        for column, cell in zip(table.columns, cells, strict=True)
        if cell is not None
    ]


def _values(cell: TableCell) -> dict[str, Any]:
    return {
        "average": cell.kind,
        **{name: _number(getattr(cell, name)) for name in ("mean", "low", "high")},
        "quartiles": [_number(value) for value in cell.quartiles],
        **{name: int(getattr(cell, name)) for name in ("runs", "diverged", "failed", "missing", "locked")},
        "replicate": cell.replicate,
        "best": bool(cell.best),
        "ratio": _ratio(cell.ratio) if cell.ratio else None,
    }


def _ratio(ratio: Ratio) -> dict[str, Any]:
    numbers = {name: _number(getattr(ratio, name)) for name in ("value", "low", "high", "p")}
    return {**numbers, "different": ratio.mark == "*", "equal": ratio.mark == "="}


def _number(value: float) -> float | str | None:
    if value == math.inf:
        return LOST
    return float(value) if math.isfinite(value) else None
