"""The columns of a study's rows: quantities with their units, factors, references, and checks of both."""

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
"""Last part of a column's name, and the unit that it stands for."""

STEP = Column("Time a step: one run alone, the quickest of five")
"""The column that `jerkbench.jobs.replay` adds."""

_WORDS = {"rmse": "RMSE", "anees": "ANEES", "anis": "ANIS", "max": "maximum"}
"""Parts of column names that are not plain words."""


def declared() -> Mapping[str, Column]:
    """Return how columns are read, by their names, as the metrics say."""
    return _declared(tuple(plugins.get("metric", name) for name in plugins.names("metric")))


@cache
def _declared(metrics: tuple[type, ...]) -> Mapping[str, Column]:
    """Of a column that two metrics explain ours counts."""
    each = (getattr(metric, "columns", {}) for metric in sorted(metrics, key=plugins.is_own))
    return {name: of for columns in each for name, of in columns.items()} | {"step_ns": STEP}


def quantity(column: str) -> Column:
    """Return how a column is read, with title and unit; names that no metric explains speak for themselves.

    >>> quantity("position_rmse_up_m").heading
    'Position RMSE up [m]'
    """
    stem, _, last = column.rpartition("_")
    unit = _UNITS.get(last, "") if stem else ""
    words = [_WORDS.get(word, word) for word in (stem if unit else column).split("_")]
    plain, of = " ".join(words), declared().get(column, Column())
    return of._replace(title=of.title or plain[:1].upper() + plain[1:], unit=of.unit or unit)


# The factors of a study in a table: those of its rows, those of its columns, and those that are alike everywhere.


FACTORS = Combination._fields

METHOD = ("filter", "adaptation", "noise")
"""What a method is made of, unless one says otherwise; the other factors make a scenario."""

SCENARIO_FACTORS = ("dataset", "disturbance", "attitude")
"""What methods are compared on."""


def require_factors(keys: Iterable[str]) -> None:
    """Raise a JerkbenchError unless each of ``keys`` is a factor."""
    for key in keys:
        require_known("factor", key, FACTORS, JerkbenchError)


def parse_method(text: str) -> tuple[str, ...]:
    """Read ``factor,factor``.

    Raises:
        JerkbenchError: there is no such factor, or none.
    """
    keys = tuple(word.strip() for word in text.split(",") if word.strip())
    require_factors(keys)
    if not keys:
        raise JerkbenchError("A method is made of at least one factor, for example filter,adaptation,noise.")
    return keys


def layout(
    rows: "pd.DataFrame", row_keys: Sequence[str] | None, column_keys: Sequence[str] | None
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the factors of the rows and of the columns.

    A factor that varies and is not asked for becomes one of the rows: unlike runs are never averaged. The columns for
    which none is asked are the adaptation (or the filter); the attitude, where it alone of the three varies.

    Raises:
        JerkbenchError: a key that is no factor, or one that is asked for twice.
    """
    keys = [*(row_keys or ()), *(column_keys or ())]
    require_factors(keys)
    for key in keys:
        if keys.count(key) > 1:
            raise JerkbenchError(f"The factor '{key}' is asked for twice; it can be a row or a column, once.")
    varying = [key for key in FACTORS if len(rows[key].unique()) > 1]
    if column_keys is None:
        free = [key for key in ("adaptation", "filter") if key not in keys]
        tilting = "attitude" in varying and "attitude" not in keys and not {"adaptation", "filter"} & set(varying)
        column_keys = ["attitude"] if tilting else free[:1]
    placed = {*(row_keys or ()), *column_keys}
    extra = [key for key in varying if key not in placed]
    first = [*(row_keys or ()), *extra] or [key for key in ("filter", "dataset") if key not in placed][:1]
    return tuple(first), tuple(column_keys)


def numbers_of_rows(rows: "pd.DataFrame", keys: Sequence[str]) -> dict[tuple[str, ...], IntArray]:
    """Return for each combination of ``keys`` the numbers of its rows, in the order in which they appear."""
    groups: dict[tuple[str, ...], list[int]] = {}
    for number, key in enumerate(zip(*(rows[key].tolist() for key in keys), strict=True)):
        groups.setdefault(key, []).append(number)
    return {key: np.array(group) for key, group in groups.items()}


def constants(rows: "pd.DataFrame", placed: Iterable[str]) -> tuple[tuple[str, str], ...]:
    """Return the factors that are neither rows nor columns, each with its one value."""
    if len(rows) == 0:
        return ()
    used = set(placed)
    return tuple((key, str(rows[key].iloc[0])) for key in FACTORS if key not in used)


# Combinations that stand in a study as a reference and compete with nobody.

ORACLE, GNSS_ONLY = "oracle", "gnss_only"

WHY = {"adaptation": {ORACLE: "is told the true covariance"}, "filter": {GNSS_ONLY: "is the floor, without an IMU"}}
"""Factor -> label without its parameters -> why it does not compete."""

TOLD_ATTITUDE = "reference"
"""This attitude is the reference's own; it makes a scenario, and competes with no other attitude."""


def competes(values: Mapping[str, str]) -> bool:
    """Whether a combination can be the best, by the labels of some of its factors.

    >>> competes({"filter": "jerk", "adaptation": "oracle"})
    False
    """
    return not any(_name(values.get(factor, "")) in references for factor, references in WHY.items())


def standing_apart(labels: Mapping[str, set[str]]) -> str:
    """Return a sentence about those that are among the labels of each factor; empty where none is."""
    apart = [
        f"{name} ({why})"
        for factor, references in WHY.items()
        for name, why in references.items()
        if name in {_name(label) for label in labels.get(factor, ())}
    ]
    return f"{' and '.join(apart)} {'do' if len(apart) > 1 else 'does'} not compete." if apart else ""


def _name(label: str) -> str:
    return label.partition("(")[0]


# Rows of runs: which columns are metrics, and whether they can be tabulated.

_IDENTITY = (*FACTORS, *RUN_COLUMNS)
"""Columns of a row that are not metrics."""


def metric_columns(rows: "pd.DataFrame") -> list[str]:
    """Return the columns that hold metrics: numbers that are neither part of a row's identity nor what was drawn."""
    numbers = rows.select_dtypes("number").columns
    return [str(column) for column in numbers if column not in _IDENTITY and not str(column).startswith(DRAWN)]


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
    empty = metric not in _IDENTITY and metric in rows.columns and rows[metric].isna().all()  # no run has a value
    if not empty and (metric in _IDENTITY or (rows["status"] == "ok").any()):
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
