"""The growth of the position error while there is no aiding."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import mean
from jerkbench.evaluation.sums import sums_of
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.sums import Sums


@register("metric", "outage_drift")
@dataclass(frozen=True)
class OutageDrift:
    """Growth of the position error over an outage, per second.

    With f(j) and l(j) the first and the last row inside outage j, as in the metric `outage`, and e_i the error [m]::

        outage_drift_mps = mean over j of |e_l(j) - e_f(j)|/(t_l(j) - t_f(j))

    The error with which the outage began does not count. NaN without an outage of two rows.
    """

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the value by column name."""
        return self.summarise(sums_of(estimate, recording, counted))

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the same from the sums of a run."""
        drifts = sums.outage_drifts_mps[~np.isnan(sums.outage_drifts_mps)]
        return {"outage_drift_mps": mean(float(drifts.sum()), float(drifts.size))}
