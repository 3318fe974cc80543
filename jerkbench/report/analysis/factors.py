"""The factors of a study in a table: those of its rows, those of its columns, and those that are alike everywhere."""

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from jerkbench.errors import JerkbenchError, unknown

if TYPE_CHECKING:
    import pandas as pd

FACTORS = ("dataset", "disturbance", "attitude", "filter", "adaptation", "noise")
"""What a cell is a combination of, in the order of the data's way."""

METHOD = ("filter", "adaptation", "noise")
"""What a method is made of, unless one says otherwise; the other factors make a scenario."""


def parse_method(text: str) -> tuple[str, ...]:
    """Read ``factor,factor``.

    Raises:
        JerkbenchError: there is no such factor, or none.
    """
    keys = tuple(word.strip() for word in text.split(",") if word.strip())
    for key in keys:
        if key not in FACTORS:
            raise JerkbenchError(unknown("factor", key, FACTORS))
    if not keys:
        raise JerkbenchError("A method is made of at least one factor, for example filter,adaptation,noise.")
    return keys


def default_method(rows: "pd.DataFrame") -> tuple[str, ...]:
    """Return what a method is made of where nobody says: `METHOD`, or the attitude where it alone varies."""
    varying = {key for key in (*METHOD, "attitude") if len(rows[key].unique()) > 1}
    return ("attitude",) if varying == {"attitude"} else METHOD


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
    _check(keys)
    varying = [key for key in FACTORS if len(rows[key].unique()) > 1]
    if column_keys is None:
        free = [key for key in ("adaptation", "filter") if key not in keys]
        tilting = "attitude" in varying and "attitude" not in keys and not {"adaptation", "filter"} & set(varying)
        column_keys = ["attitude"] if tilting else free[:1]
    placed = {*(row_keys or ()), *column_keys}
    extra = [key for key in varying if key not in placed]
    first = [*(row_keys or ()), *extra] or [key for key in ("filter", "dataset") if key not in placed][:1]
    return tuple(first), tuple(column_keys)


def constants(rows: "pd.DataFrame", placed: Iterable[str]) -> tuple[tuple[str, str], ...]:
    """Return the factors that are neither rows nor columns, each with its one value."""
    if len(rows) == 0:
        return ()
    used = set(placed)
    return tuple((key, str(rows[key].iloc[0])) for key in FACTORS if key not in used)


def _check(keys: Sequence[str]) -> None:
    for key in keys:
        if key not in FACTORS:
            raise JerkbenchError(unknown("factor", key, FACTORS))
        if keys.count(key) > 1:
            raise JerkbenchError(f"The factor '{key}' is asked for twice; it can be a row or a column, once.")
