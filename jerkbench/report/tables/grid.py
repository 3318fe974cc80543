"""The place of every run in a table, which the tables of all metrics share."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jerkbench.arrays import IntArray
from jerkbench.report.analysis.factors import layout
from jerkbench.report.analysis.rows import with_text_factors

if TYPE_CHECKING:
    import pandas as pd

Values = tuple[str, ...]
"""One value of each of some factors."""


class Tally(NamedTuple):
    """How the runs of a place ended, and whether they are phases of one recording."""

    runs: int
    diverged: int
    failed: int
    phase: bool


@dataclass(frozen=True, eq=False)
class Grid:
    """The places of a table, and the runs of each.

    Attributes:
        rows: one row a run, the factors as text.
        across: factors of the table's rows.
        down: factors of its columns.
        row_values: the combinations of ``across``, grouped, values in the order in which they appear.
        column_values: those of ``down``.
        runs: for each combination of both, the numbers of its rows.
        status: how each run ended.
        phase: whether a run is a phase of one recording, not a seed.
    """

    rows: "pd.DataFrame"
    across: tuple[str, ...]
    down: tuple[str, ...]
    row_values: tuple[Values, ...]
    column_values: tuple[Values, ...]
    runs: dict[Values, IntArray]
    status: NDArray[np.str_]
    phase: NDArray[np.bool_]

    @cached_property
    def good(self) -> dict[Values, IntArray]:
        """The numbers of those rows of each place whose run went well."""
        ok = self.status == "ok"
        return {key: runs[ok[runs]] for key, runs in self.runs.items()}

    @cached_property
    def tallies(self) -> list[Tally]:
        """How the runs of each place ended, in the order of `runs`."""
        diverged, failed = self.status == "diverged", self.status == "failed"
        return [
            Tally(len(runs), int(diverged[runs].sum()), int(failed[runs].sum()), bool(self.phase[runs].any()))
            for runs in self.runs.values()
        ]


def arranged(rows: "pd.DataFrame", row_keys: Sequence[str] | None, column_keys: Sequence[str] | None) -> Grid:
    """Return the places of ``rows`` in a table of these factors.

    Raises:
        JerkbenchError: no such factor, or two rows of the same combination and seed.
    """
    rows = with_text_factors(rows)
    across, down = layout(rows, row_keys, column_keys)
    status, replicate = (rows[name].to_numpy(dtype=str) for name in ("status", "replicate"))
    runs = _runs(rows, [*across, *down])
    row_values = _grouped(key[: len(across)] for key in runs) if across else ((),)
    column_values = _grouped(key[len(across) :] for key in runs) if down else ((),)
    return Grid(rows, across, down, row_values, column_values, runs, status, replicate == "phase")


def _grouped(values: Iterable[Values]) -> tuple[Values, ...]:
    """Return each combination once, what has the first value in common together; values as they appear first."""
    found = list(dict.fromkeys(values))
    ranks = [{value: rank for rank, value in enumerate(dict.fromkeys(of))} for of in zip(*found, strict=True)]
    return tuple(sorted(found, key=lambda one: [rank[value] for rank, value in zip(ranks, one, strict=True)]))


def _runs(rows: "pd.DataFrame", keys: list[str]) -> dict[Values, IntArray]:
    """Return the row numbers of each combination of ``keys``."""
    groups: dict[Values, list[int]] = {}
    for number_of_row, key in enumerate(zip(*(rows[key].tolist() for key in keys), strict=True)):
        groups.setdefault(key, []).append(number_of_row)
    return {key: np.array(group) for key, group in groups.items()}
