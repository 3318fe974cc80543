"""The accuracy of the RMSE of one recording."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import known, position_error_m
from jerkbench.evaluation.statistics.correlated_errors import block_interval
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("metric", "one_recording")
@dataclass(frozen=True)
class OneRecording:
    """Interval of the position RMSE from one recording, by a moving-block bootstrap.

    Blocks are at least four times as long as the squared errors remember, so that errors which follow each other count
    once::

        position_rmse_low_m, position_rmse_high_m   95 % interval of position_rmse_m
        error_correlation_rows                      rows that count as one: 1 + 2 sum of the autocorrelations of |e_i|^2

    It speaks for other stretches of such a drive, not for other drives. NaN where the recording is too short to say:
    fewer than 75 times as many rows as count as one. Computed by default where a cell has no seeds, and on request.

    Source: Künsch, "The jackknife and the bootstrap for general stationary observations", Ann. Statist. 17 (1989).
    """

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values by column name."""
        rows = counted & known(recording.reference.enu_m, estimate)
        with np.errstate(over="ignore", invalid="ignore"):
            interval = block_interval(np.sum(position_error_m(estimate, recording)[rows] ** 2, axis=1))
        return {
            "position_rmse_low_m": interval.low,
            "position_rmse_high_m": interval.high,
            "error_correlation_rows": interval.correlation,
        }
