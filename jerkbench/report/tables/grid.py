"""The places of a table with their runs, which the tables of all metrics share; their numbers in one metric."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import BoolArray, IntArray
from jerkbench.evaluation.statistics.errors_over_seeds import MEAN, centres_of, no_centres
from jerkbench.evaluation.statistics.families import LEAST_SEEDS
from jerkbench.evaluation.statistics.over_seeds import Samples, mean_intervals_of
from jerkbench.report.analysis.columns import constants, layout, numbers_of_rows, quantity, with_text_factors
from jerkbench.report.tables.table_model import Table, TableCell

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
        order: the numbers of the rows of one place after those of the other.
        ok: whether each run went well, in this order.
        sizes: how many runs each place has.
        diverged: how many of them diverged.
        failed: how many of them failed.
        phases: whether they are phases of one recording, not seeds.
    """

    rows: "pd.DataFrame"
    across: tuple[str, ...]
    down: tuple[str, ...]
    row_values: tuple[Values, ...]
    column_values: tuple[Values, ...]
    runs: dict[Values, IntArray]
    order: IntArray
    ok: BoolArray
    sizes: IntArray
    diverged: IntArray
    failed: IntArray
    phases: BoolArray

    def samples(self, column: str) -> Samples:
        """Return the values of a column, by place."""
        return Samples(self.rows[column].to_numpy(dtype=float)[self.order], self.sizes)

    def cells(self, metric: str) -> dict[Values, TableCell]:
        """Return the cell of each place; of phases the interval is that of the recording, or their range."""
        values = self.samples(metric)
        good = values.only(self.ok)
        missing = good.count(np.isnan(good.values))
        # an error of which a geometric mean, or a median with losses at the top, makes sense
        if quantity(metric).lowest_is_best and not np.less(good.values, 0).any():
            least = np.where(self.phases, np.inf, LEAST_SEEDS)
            centres = centres_of(Samples(np.where(self.ok, values.values, np.inf), values.sizes), least=least)
            nothing = missing == good.sizes
            centres[nothing] = no_centres(int(nothing.sum()), centres.kind[nothing])
        else:
            centres = no_centres(len(self.runs), MEAN)
            centres.value, centres.low, centres.high = mean_intervals_of(good)
        own = self.phases & (good.sizes > 0) & all(name in self.rows for name in OWN_INTERVAL.get(metric, ("",)))
        centres.low[self.phases] = centres.high[self.phases] = np.nan
        for places, of_phases in good.only(self.phases[good.owner]).without_nan().by_size():
            if of_phases.shape[1] > 1:  # one has no range
                centres.low[places], centres.high[places] = of_phases.min(axis=1), of_phases.max(axis=1)
        for ends, name in zip(
            (centres.low, centres.high), OWN_INTERVAL.get(metric, ()) if own.any() else (), strict=False
        ):
            with np.errstate(divide="ignore"):  # a filter that hands on its reference has no error
                logs = Samples(np.log(self.samples(name).values), self.sizes).only(self.ok)
            for places, of_phases in logs.only(own[logs.owner]).by_size():
                if of_phases.shape[1]:
                    ends[places] = np.exp(of_phases.mean(axis=1))
        counts = (self.sizes, self.diverged, self.failed, missing, self.phases, own)
        columns = zip(self.runs, centres.tolist(), *(of.tolist() for of in counts), strict=True)
        cells = {}
        for place, centre, runs, diverged, failed, absent, phase, owned in columns:
            kind, mean, low, high, lower, upper, geometric, locked = centre
            counted, quartiles = (runs, diverged, failed, absent, "phase" if phase else "seed"), (lower, upper)
            cells[place] = TableCell(mean, low, high, *counted, kind, locked, quartiles, geometric, owned)
        return cells

    def table(self, metric: str, cells: Mapping[Values, TableCell]) -> Table:
        """Return a table of ``cells`` without footnotes."""
        lines = ((cells.get((*row, *column)) for column in self.column_values) for row in self.row_values)
        return Table(
            *(quantity(metric).heading, metric, quantity(metric).unit),
            row_keys=self.across,
            column_keys=self.down,
            rows=self.row_values,
            columns=self.column_values,
            cells=tuple(map(tuple, lines)),
            constants=constants(self.rows, (*self.across, *self.down)),
            average=Counter(cell.kind for cell in cells.values()).most_common(1)[0][0] if cells else MEAN,
        )


def arranged(rows: "pd.DataFrame", row_keys: Sequence[str] | None, column_keys: Sequence[str] | None) -> Grid:
    """Return the places of ``rows`` in a table of these factors.

    Raises:
        JerkbenchError: no such factor, or two rows of the same combination and seed.
    """
    rows = with_text_factors(rows)
    across, down = layout(rows, row_keys, column_keys)
    runs = numbers_of_rows(rows, [*across, *down])
    row_values = _grouped(key[: len(across)] for key in runs) if across else ((),)
    column_values = _grouped(key[len(across) :] for key in runs) if down else ((),)
    order = np.concatenate([np.empty(0, np.int64), *runs.values()])
    samples = Samples(np.zeros(len(order)), np.array([len(of) for of in runs.values()], dtype=np.int64))
    status, replicate = (rows[name].to_numpy(dtype=str)[order] for name in ("status", "replicate"))
    diverged, failed, phases = map(samples.count, (status == "diverged", status == "failed", replicate == "phase"))
    found = across, down, row_values, column_values, runs, order, status == "ok", samples.sizes
    return Grid(rows, *found, diverged, failed, phases > 0)


def _grouped(values: Iterable[Values]) -> tuple[Values, ...]:
    """Return each combination once, what has the first value in common together; values as they appear first."""
    combinations = list(dict.fromkeys(values))
    ranks = [{value: rank for rank, value in enumerate(dict.fromkeys(of))} for of in zip(*combinations, strict=True)]
    return tuple(
        sorted(
            combinations, key=lambda combination: [rank[value] for rank, value in zip(ranks, combination, strict=True)]
        )
    )
