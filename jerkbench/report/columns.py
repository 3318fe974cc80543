"""The columns in the result rows of a study: metrics with their units, factors, reference methods, and checks."""

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from jerkbench import plugins
from jerkbench.arrays import IntArray
from jerkbench.errors import JerkbenchError, require_known, unknown
from jerkbench.evaluation.evaluated_run import DRAWN, RUN_COLUMNS, Combination
from jerkbench.parameters import Column

if TYPE_CHECKING:
    import pandas as pd


_UNITS = {
    "m": "m",
    "mps": "m/s",
    "rad": "rad",
    "deg": "deg",
    "radps": "rad/s",
    "s": "s",
    "us": "µs",
    "ns": "ns",
    "db": "dB",
    "percent": "%",
}
"""The unit for each last part of a column name."""

STEP = Column("Time a step: one run alone, the quickest of five")
"""Description of the column step_ns."""

_SPELLINGS = {"rmse": "RMSE", "anees": "ANEES", "anis": "ANIS", "max": "maximum"}
"""Spelling of abbreviations in column names, for titles."""


def declared() -> Mapping[str, Column]:
    """Return the description of each column that a metric plugin declares, by the name of the column."""
    return _declared(tuple(plugins.get("metric", name) for name in plugins.names("metric")))


@cache
def _declared(metrics: tuple[type, ...]) -> Mapping[str, Column]:
    """Return the description of each column that one of the ``metrics`` declares.

    If two metrics declare the same column, the description of the builtin metric is used.
    """
    each = (getattr(metric, "columns", {}) for metric in sorted(metrics, key=plugins.is_builtin))
    return {name: of for columns in each for name, of in columns.items()} | {"step_ns": STEP}


def quantity(column: str) -> Column:
    """Return the description of a column.

    A title or unit that no metric declares is derived from the name of the column.

    >>> quantity("position_rmse_up_m").heading
    'Position RMSE up [m]'
    """
    stem, _, last = column.rpartition("_")
    unit = _UNITS.get(last, "") if stem else ""
    parts = [_SPELLINGS.get(part, part) for part in (stem if unit else column).split("_")]
    plain, of = " ".join(parts), declared().get(column, Column())
    return of._replace(title=of.title or plain[:1].upper() + plain[1:], unit=of.unit or unit)


# The layout of a table: each factor of a study (such as filter) defines rows, defines columns, or is constant.


FACTORS = Combination._fields

METHOD = ("filter", "adaptation", "noise")
"""Factors that define a method by default. All other factors define the scenario."""

MAIN = "position_rmse_m"
"""The default metric of a table."""

SCENARIO_FACTORS = ("dataset", "disturbance", "attitude")
"""Factors that define a scenario by default."""


def require_factors(keys: Iterable[str]) -> None:
    """Check that all ``keys`` are names of factors, such as "filter".

    Raises:
        JerkbenchError: a key is not the name of a factor.
    """
    for key in keys:
        require_known("factor", key, FACTORS, JerkbenchError)


def varying_factors(rows: "pd.DataFrame") -> tuple[str, ...]:
    """Return the factors in which the combinations differ."""
    return tuple(key for key in FACTORS if len(set(map(str, rows[key].unique()))) > 1)


def parse_method(text: str) -> tuple[str, ...]:
    """Convert a text with comma-separated factors, such as "filter,adaptation", to a tuple.

    Raises:
        JerkbenchError: a factor is unknown, or the text is empty.
    """
    keys = tuple(part.strip() for part in text.split(",") if part.strip())
    require_factors(keys)
    if not keys:
        raise JerkbenchError("No factor of the method is given; give one or more, for example filter,adaptation,noise.")
    return keys


def layout(
    rows: "pd.DataFrame", row_keys: Sequence[str] | None, column_keys: Sequence[str] | None
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the factors that define the rows and the factors that define the columns of a table.

    A varying factor that is not requested becomes a factor of the rows, because the average of different combinations
    would be meaningless. By default, each adaptation has a column. If the adaptation is a requested row factor, each
    filter has a column. If the attitude filter varies, but neither the adaptation nor the filter varies, each attitude
    filter has a column.

    Raises:
        JerkbenchError: a key is not the name of a factor, or a factor is requested twice.
    """
    keys = [*(row_keys or ()), *(column_keys or ())]
    require_factors(keys)
    for key in keys:
        if keys.count(key) > 1:
            raise JerkbenchError(f"The factor '{key}' is given twice; it can be a row or a column, not both.")
    varying = varying_factors(rows)
    if column_keys is None:
        free = [key for key in ("adaptation", "filter") if key not in keys]
        tilting = "attitude" in varying and "attitude" not in keys and not {"adaptation", "filter"} & set(varying)
        column_keys = ["attitude"] if tilting else free[:1]
    placed = {*(row_keys or ()), *column_keys}
    extra = [key for key in varying if key not in placed]
    first = [*(row_keys or ()), *extra] or [key for key in ("filter", "dataset") if key not in placed][:1]
    return tuple(first), tuple(column_keys)


def numbers_of_rows(rows: "pd.DataFrame", keys: Sequence[str]) -> dict[tuple[str, ...], IntArray]:
    """Return the row numbers of each combination of labels of the factors ``keys``, in order of first appearance."""
    groups: dict[tuple[str, ...], list[int]] = {}
    for number, key in enumerate(zip(*(rows[key].tolist() for key in keys), strict=True)):
        groups.setdefault(key, []).append(number)
    return {key: np.array(group) for key, group in groups.items()}


# Reference methods show a bound or a baseline. They do not compete with the other methods of a study.

ORACLE, GNSS_ONLY = "oracle", "gnss_only"

REFERENCE_METHODS = {"adaptation": ORACLE, "filter": GNSS_ONLY}
"""For each factor, the label (without parameters) of the reference method: true covariance, and no IMU."""

REFERENCE_ATTITUDE = "reference"
"""Label of the attitude of the reference. This attitude may define a scenario, but does not compete with estimates."""


def competes(values: Mapping[str, str]) -> bool:
    """Return False for a reference method, and True for a method that competes. ``values`` maps factors to labels.

    >>> competes({"filter": "jerk", "adaptation": "oracle"})
    False
    """
    return not any(values.get(factor, "").partition("(")[0] == name for factor, name in REFERENCE_METHODS.items())


# Result rows of runs: the columns with metrics, and checks before a table is created.

_IDENTITY = (*FACTORS, *RUN_COLUMNS)
"""Columns of a row that are not metrics."""


def metric_columns(rows: "pd.DataFrame") -> list[str]:
    """Return the metric columns: numeric columns except labels, run columns and random parameters of a drive."""
    numbers = rows.select_dtypes("number").columns
    return [str(column) for column in numbers if column not in _IDENTITY and not str(column).startswith(DRAWN)]


def checked(rows: "pd.DataFrame", metric: str) -> "pd.DataFrame":
    """Return a copy of the rows in which all factors are texts and the column of the metric exists."""
    return with_text_factors(with_metric(rows, metric))


def with_metric(rows: "pd.DataFrame", metric: str) -> "pd.DataFrame":
    """Return ``rows`` with the column of the metric. If no run succeeded, a missing column is added with NaN.

    Raises:
        JerkbenchError: ``metric`` is not a metric column, although at least one run succeeded.
    """
    if metric in metric_columns(rows):
        return rows
    empty = metric not in _IDENTITY and metric in rows.columns and rows[metric].isna().all()
    if not empty and (metric in _IDENTITY or (rows["status"] == "ok").any()):
        raise JerkbenchError(unknown("metric", metric, metric_columns(rows)))
    return rows.assign(**{metric: np.nan})


def with_text_factors(rows: "pd.DataFrame") -> "pd.DataFrame":
    """Return a copy of the rows in which all factors are texts.

    Raises:
        JerkbenchError: two rows have the same combination and seed.
    """
    rows = rows.assign(**{key: rows[key].astype(str) for key in FACTORS})
    repeated = rows[rows.duplicated([*FACTORS, "seed"])]
    if len(repeated):
        first = repeated.iloc[0]
        names = ", ".join(f"{key} {first[key]}" for key in FACTORS)
        raise JerkbenchError(
            f"{len(repeated)} rows repeat the combination and seed of another row, first {names}, seed {first['seed']}."
            " Give different names to combinations with different parameters, or remove the repeated rows."
        )
    return rows
