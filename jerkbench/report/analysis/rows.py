"""Rows of runs: which columns are metrics, and whether they can be tabulated."""

from typing import TYPE_CHECKING

import numpy as np

from jerkbench.errors import JerkbenchError, unknown
from jerkbench.evaluation.evaluated_run import RUN
from jerkbench.report.analysis.factors import FACTORS

if TYPE_CHECKING:
    import pandas as pd

IDENTITY = (*FACTORS, *RUN)
"""Columns of a row that are not metrics."""


def metric_columns(rows: "pd.DataFrame") -> list[str]:
    """Return the columns that hold metrics: numbers that are not part of a row's identity."""
    numbers = rows.select_dtypes("number").columns
    return [str(column) for column in numbers if column not in IDENTITY]


def checked(rows: "pd.DataFrame", metric: str) -> "pd.DataFrame":
    """Return a copy with the factors as text and the metric as `with_metric` has it."""
    return with_text_factors(with_metric(rows, metric))


def with_metric(rows: "pd.DataFrame", metric: str) -> "pd.DataFrame":
    """Return ``rows`` with a column of the metric, which is missing only where no run went well.

    Raises:
        JerkbenchError: there is no such metric; what tells rows apart, and text, is none.
    """
    if metric in metric_columns(rows):
        return rows
    if metric not in IDENTITY and metric in rows.columns and rows[metric].isna().all():
        return rows.assign(**{metric: np.nan})  # no run has a value
    if metric in IDENTITY or (rows["status"] == "ok").any():
        raise JerkbenchError(unknown("metric", metric, metric_columns(rows)))
    return rows.assign(**{metric: np.nan})


def with_text_factors(rows: "pd.DataFrame") -> "pd.DataFrame":
    """Return a copy with the factors as text; no combination may have a seed twice."""
    rows = rows.assign(**{key: rows[key].astype(str) for key in FACTORS})
    repeated = rows[rows.duplicated([*FACTORS, "seed"])]
    if len(repeated):
        first = repeated.iloc[0]
        names = ", ".join(f"{key} {first[key]}" for key in FACTORS)
        raise JerkbenchError(
            f"{len(repeated)} rows repeat a combination and seed, first {names}, seed {first['seed']}; "
            "give combinations with different parameters different names, or keep one row of each."
        )
    return rows
