"""The objectives: what a setting is worth on a case, as one number; the smaller, the better."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import PluginError, unknown
from jerkbench.jobs.rows import Row

LOST = math.log(100.0)
"""What a lost run counts, and the most that any counts: a hundred times the error of the plain filter."""


@dataclass(frozen=True)
class Objective:
    """A column of a run's row, compared with what the plain filter has in it.

    Attributes:
        name: what one asks for.
        metric: the metric that gives the column.
        column: of a row.
        relative: whether the logarithm of the ratio to the plain filter counts, or the difference.
        reference: the part of the reference that a recording needs to be tuned on; empty: none.
        meaning: what its numbers say, one phrase.
    """

    name: str
    metric: str
    column: str
    relative: bool
    reference: str
    meaning: str

    def losses(self, rows: Sequence[Row], plain: float) -> FloatArray:
        """Return (len(rows),) the loss of each run; ``plain`` is the `level` of the plain filter over the scenario.

        With c the column: log(c/plain), or c - plain; of a run that is lost log 100, and never more than that.
        """
        values = [self._value(row) for row in rows]
        losses = [LOST if math.isnan(value) else self._difference(value, plain) for value in values]
        return np.asarray(np.minimum(losses, LOST))

    def level(self, rows: Sequence[Row], limit_m: float) -> float:
        """Return the mean of the runs that came to their end: geometric of errors, plain of scores.

        Where all are lost it is the error at which a run is lost, ``limit_m``, or a score of 0.
        """
        values = np.array([self._value(row) for row in rows])
        values = values[np.isfinite(values)]
        if not len(values):
            return limit_m if self.relative else 0.0
        return float(np.exp(np.log(values).mean()) if self.relative else values.mean())

    def _difference(self, value: float, plain: float) -> float:
        return math.log(value / plain) if self.relative else value - plain

    def _value(self, row: Row) -> float:
        """The column of a run that came to its end, else NaN."""
        value = float(row.get(self.column, math.nan)) if row["status"] == "ok" else math.nan
        return value if math.isfinite(value) and (value > 0 or not self.relative) else math.nan


RATIO = "position RMSE as a ratio to the plain filter at its defaults, geometric mean; a lost run counts 100"
TILT = "inclination RMSE as a ratio to mekf at its defaults, geometric mean; a lost run counts 100"
NATS = "nats an update by which the measurements are less likely than under the plain filter at its defaults"

OBJECTIVES = {
    "rmse": Objective("rmse", "position_rmse", "position_rmse_m", relative=True, reference="enu_m", meaning=RATIO),
    "inclination": Objective(
        "inclination", "inclination", "inclination_rmse_deg", relative=True, reference="euler_rad", meaning=TILT
    ),
    "likelihood": Objective(
        "likelihood",
        "innovation_likelihood",
        "innovation_log_loss",
        relative=False,
        reference="",
        meaning=NATS,
    ),
}


def objective_of(name: str) -> Objective:
    """Return the objective ``name``.

    Raises:
        PluginError: there is none.
    """
    if name not in OBJECTIVES:
        raise PluginError(unknown("objective", name, OBJECTIVES))
    return OBJECTIVES[name]
