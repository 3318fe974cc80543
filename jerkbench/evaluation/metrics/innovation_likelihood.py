"""The likelihood of the innovations: how well a filter foretells its own measurements, without any reference."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_stamps import first_counted_s
from jerkbench.plugins import register
from jerkbench.recording import Recording


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
