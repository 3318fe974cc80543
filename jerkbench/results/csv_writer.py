"""Rows of runs -> rows.csv: what pandas would write, a stretch of rows at a time and several times as fast.

Its columns come from the metrics (`jerkbench/evaluation/metrics/`).
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from jerkbench.report.tables.writers import csv_escaped, csv_line, csv_number

STRETCH = 20_000
"""So many rows are in memory as text."""


def write_rows_csv(rows: pd.DataFrame, path: Path) -> None:
    """Write a header and one line a row; what is missing is empty."""
    with path.open("w", encoding="utf-8", newline="") as file:
        file.write(csv_line(csv_escaped(str(name)) for name in rows.columns))
        for begin in range(0, len(rows), STRETCH):
            file.writelines(_lines(rows.iloc[begin : begin + STRETCH]))


def _lines(rows: pd.DataFrame) -> Iterator[str]:
    columns = [_texts(rows.iloc[:, place]) for place in range(rows.shape[1])]
    return map(csv_line, zip(*columns, strict=True))


def _texts(column: pd.Series) -> list[str]:
    if column.dtype == np.float64:
        return list(map(csv_number, column.tolist()))
    missing = column.isna().to_numpy()
    return ["" if absent else csv_escaped(str(value)) for value, absent in zip(column.tolist(), missing, strict=True)]
