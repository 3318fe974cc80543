"""The places of a table with their runs, which the tables of all metrics share; their numbers in one metric."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.evaluation.statistics.errors_over_seeds import MEAN, Centres, centres_of
from jerkbench.evaluation.statistics.families import LEAST_SEEDS
from jerkbench.evaluation.statistics.over_seeds import Samples, mean_intervals_of
from jerkbench.report.analysis.columns import layout, numbers_of_rows, quantity, with_text_factors
from jerkbench.report.tables.table_model import TableCell

if TYPE_CHECKING:
    import pandas as pd

OWN_INTERVAL = {"position_rmse_m": ("position_rmse_low_m", "position_rmse_high_m")}
"""Where the rows of one recording have the interval of a metric (metric one_recording)."""

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
    runs = numbers_of_rows(rows, [*across, *down])
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


@dataclass(frozen=True, eq=False)
class CellColumns:
    """The numbers of each place of a grid, in the order of its `runs`.

    Attributes:
        grid: with its counts of runs.
        centres: what stands for the runs, with an interval; of phases that of the recording, or their range.
        missing: (k,) how many runs went well, but have no value.
        own_interval: (k,) whether the interval is that of one recording.
    """

    grid: Grid
    centres: Centres
    missing: IntArray
    own_interval: BoolArray

    @property
    def applies(self) -> bool:
        """Whether any place has a value."""
        return not bool(np.isnan(self.centres.value).all())

    def cells(self) -> list[TableCell]:
        """Each place as a cell of a table."""
        grid = self.grid
        words = np.where(grid.phases, "phase", "seed").tolist()
        counts = (grid.sizes, grid.diverged, grid.failed, self.missing, self.own_interval)
        known = zip(self.centres, words, *(count.tolist() for count in counts), strict=True)
        return [
            TableCell(
                *(of.value, of.low, of.high),
                *(runs, diverged, failed, missing),
                replicate=word,
                own_interval=own,
                kind=of.kind,
                locked=of.locked,
                quartiles=of.quartiles,
                geometric=of.geometric,
            )
            for of, word, runs, diverged, failed, missing, own in known
        ]


def cell_columns(grid: Grid, metric: str) -> CellColumns:
    """Return the numbers of every place of ``grid`` in ``metric``."""
    values = grid.samples(grid.rows[metric].to_numpy(dtype=float))
    good = values.only(grid.ok)
    missing = good.count(np.isnan(good.values))
    # an error of which a geometric mean, or a median with losses at the top, makes sense
    if quantity(metric).lowest_is_best and not np.less(good.values, 0).any():
        least = np.where(grid.phases, np.inf, LEAST_SEEDS)
        centres = centres_of(Samples(np.where(grid.ok, values.values, np.inf), values.sizes), least=least)
        nothing = np.flatnonzero(missing == good.sizes)
        centres.put(nothing, Centres.of_nothing(len(nothing), centres.kind[nothing]))
    else:
        centres = Centres.of_nothing(len(grid.runs), MEAN)
        centres.value[:], centres.low[:], centres.high[:] = mean_intervals_of(good)
    own = grid.phases & (good.sizes > 0) & all(name in grid.rows for name in OWN_INTERVAL.get(metric, ("",)))
    _put_ranges(centres, good, grid.phases)
    if own.any():
        _put_own_intervals(centres, grid, OWN_INTERVAL[metric], own)
    return CellColumns(grid, centres, missing, own)


def _put_ranges(centres: Centres, good: Samples, phases: BoolArray) -> None:
    """Put the smallest and the largest value in the place of the interval of phases; one has no range."""
    centres.low[phases] = centres.high[phases] = np.nan
    for places, values in good.only(phases[good.owner]).without_nan().by_size():
        if values.shape[1] > 1:
            centres.low[places], centres.high[places] = values.min(axis=1), values.max(axis=1)


def _put_own_intervals(centres: Centres, grid: Grid, names: tuple[str, str], own: BoolArray) -> None:
    """Put the block bootstrap's interval of each cell of one recording; over its phases the mean of the logarithms."""
    for ends, name in zip((centres.low, centres.high), names, strict=True):
        with np.errstate(divide="ignore"):  # a filter that hands on its reference has no error
            logs = grid.samples(np.log(grid.rows[name].to_numpy(dtype=float))).only(grid.ok)
        for places, values in logs.only(own[logs.owner]).by_size():
            if values.shape[1]:
                ends[places] = np.exp(values.mean(axis=1))
