"""The correlation of each innovation with the next."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_rows import first_counted_s
from jerkbench.evaluation.statistics.correlated_errors import whiteness_of_rows
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


# The likelihood of the innovations: how well a filter foretells its own measurements, without any reference.


@register("metric", "innovation_likelihood")
@dataclass(frozen=True)
class InnovationLikelihood:
    """Mean negative log-likelihood of the innovations; the lowest is the best.

    With y_k the innovation of m_k rows and S_k = H P- H' + R, R as the filter is told it, over the N updates from the
    first counted row on::

        innovation_log_loss = 1/(2 N) sum (y_k' S_k^-1 y_k + log det S_k + m_k log 2 pi)      [nats an update]

    It needs no reference: a log of one's own will do. S is that before any adaptation has looked at the innovation: an
    R that was fitted to y_k itself foretells nothing. Between methods with other rows of z it cannot be compared. NaN
    without an update, or from an estimator that does not keep det S. Not computed unless asked for:
    ``metrics=[innovation_likelihood]``.

    Source: the prediction error decomposition (F. C. Schweppe, 1965, doi:10.1109/TIT.1965.1053737).
    """

    default: ClassVar[bool] = False
    reads: ClassVar[str] = "updates"

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the value by column name."""
        updates = estimate.updates
        late = updates.t_s >= first_counted_s(recording.reference, estimate.index, counted)
        rows = updates.rows[late]
        losses = 0.5 * (updates.nis[late] + updates.log_det[late] + rows * np.log(2 * np.pi))[rows > 0]
        return {"innovation_log_loss": float(losses.mean()) if len(losses) else np.nan}
