"""The place of every run in a table, which the tables of all metrics share."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.evaluation.statistics.samples import Samples
from jerkbench.report.analysis.factors import layout
from jerkbench.report.analysis.rows import with_text_factors

if TYPE_CHECKING:
    import pandas as pd

Values = tuple[str, ...]
"""One value of each of some factors."""


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
    def order(self) -> IntArray:
        """The numbers of the rows of one place after those of the other."""
        return np.concatenate([np.empty(0, np.int64), *self.runs.values()])

    @cached_property
    def sizes(self) -> IntArray:
        """How many runs each place has."""
        return np.array([len(runs) for runs in self.runs.values()], dtype=np.int64)

    def samples(self, values: FloatArray) -> Samples:
        """Return the values (n,) of the rows, by place."""
        return Samples(values[self.order], self.sizes)

    @cached_property
    def ok(self) -> BoolArray:
        """Whether each run went well, in `order`."""
        ok: BoolArray = self.status[self.order] == "ok"
        return ok

    @cached_property
    def diverged(self) -> IntArray:
        """How many runs of each place diverged."""
        return self._count(self.status == "diverged")

    @cached_property
    def failed(self) -> IntArray:
        """How many runs of each place failed."""
        return self._count(self.status == "failed")

    @cached_property
    def phases(self) -> BoolArray:
        """Whether the runs of each place are phases of one recording."""
        phases: BoolArray = self._count(self.phase) > 0
        return phases

    def _count(self, which: BoolArray) -> IntArray:
        return self.samples(np.zeros(len(which))).count(which[self.order])


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
    combinations = list(dict.fromkeys(values))
    ranks = [{value: rank for rank, value in enumerate(dict.fromkeys(of))} for of in zip(*combinations, strict=True)]
    return tuple(
        sorted(
            combinations, key=lambda combination: [rank[value] for rank, value in zip(ranks, combination, strict=True)]
        )
    )


def _runs(rows: "pd.DataFrame", keys: list[str]) -> dict[Values, IntArray]:
    """Return the row numbers of each combination of ``keys``."""
    groups: dict[Values, list[int]] = {}
    for number_of_row, key in enumerate(zip(*(rows[key].tolist() for key in keys), strict=True)):
        groups.setdefault(key, []).append(number_of_row)
    return {key: np.array(group) for key, group in groups.items()}
