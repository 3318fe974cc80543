"""The correlation of each innovation with the next."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_stamps import first_counted_s
from jerkbench.evaluation.statistics.whiteness import whiteness_of_rows
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("metric", "innovation")
@dataclass(frozen=True)
class Innovation:
    """Correlation of successive innovations: those of an optimal filter have none.

    With rho_a(1) the autocorrelation at lag 1 of row a of the innovations, from the first counted row on, and p_a the
    p of the Ljung-Box test over 20 lags::

        innovation_correlation   = mean over the rows of rho_a(1)               expect 0
        innovation_white_percent = share of the rows with p_a >= 0.05           expect 95

    Above 0 the filter lags behind: its process noise is too small for what happens. NaN with fewer than 30 updates.
    """

    reads: ClassVar[str] = "updates"

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the two values by column name."""
        start_s = first_counted_s(recording.reference, estimate.index, counted)
        late = estimate.updates.innovation[estimate.updates.t_s >= start_s]
        tests = [test for test in whiteness_of_rows(late) if not np.isnan(test.first)]
        return {
            "innovation_correlation": float(np.mean([test.first for test in tests])) if tests else np.nan,
            "innovation_white_percent": 100 * float(np.mean([test.white for test in tests])) if tests else np.nan,
        }
