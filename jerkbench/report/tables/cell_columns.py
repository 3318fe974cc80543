"""The numbers of all cells of a table in one metric, an array of each kind."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import BoolArray, IntArray
from jerkbench.evaluation.statistics.intervals.errors_over_seeds import GEOMETRIC, MEAN, Centres, centres_of
from jerkbench.evaluation.statistics.intervals.signed_over_seeds import mean_intervals_of
from jerkbench.evaluation.statistics.samples import Samples
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.tables.grid import Grid
from jerkbench.report.tables.table_model import TableCell

OWN_INTERVAL = {"position_rmse_m": ("position_rmse_low_m", "position_rmse_high_m")}
"""Where the rows of one recording have the interval of a metric (metric one_recording)."""


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
            )
            for of, word, runs, diverged, failed, missing, own in known
        ]


def cell_columns(grid: Grid, metric: str) -> CellColumns:
    """Return the numbers of every place of ``grid`` in ``metric``."""
    values = grid.samples(grid.rows[metric].to_numpy(dtype=float))
    good = values.only(grid.ok)
    missing = good.count(np.isnan(good.values))
    if of_positive_errors(grid, metric):
        centres = _of_errors(values, grid.ok)
        nothing = np.flatnonzero(missing == good.sizes)
        centres.put(nothing, Centres.of_nothing(len(nothing), GEOMETRIC))
    else:
        centres = Centres.of_nothing(len(grid.runs), MEAN)
        centres.value[:], centres.low[:], centres.high[:] = mean_intervals_of(good)
    own = grid.phases & (good.sizes > 0) & all(name in grid.rows for name in OWN_INTERVAL.get(metric, ("",)))
    _put_ranges(centres, good, grid.phases)
    if own.any():
        _put_own_intervals(centres, grid, OWN_INTERVAL[metric], own)
    return CellColumns(grid, centres, missing, own)


def of_positive_errors(grid: Grid, metric: str) -> bool:
    """Whether the metric is an error of which a geometric mean, or a median with losses at the top, makes sense."""
    good = grid.rows[metric].to_numpy(dtype=float)[grid.status == "ok"]
    return quantity(metric).lowest_is_best and not bool(np.any(good < 0))


def _of_errors(values: Samples, ok: BoolArray) -> Centres:
    """Return the centres of all runs, of which a lost one is larger than every number."""
    return centres_of(Samples(np.where(ok, values.values, np.inf), values.sizes))


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
