"""The continuous ranked probability score of the position: metres, and honesty rewarded."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.statistics.gaussian_scores import crps
from jerkbench.evaluation.sums import sums_of
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.sums import Sums


@register("metric", "crps")
@dataclass(frozen=True)
class Crps:
    """Mean continuous ranked probability score of the filter's own Gaussian of the position; the lowest is the best.

    With e_ia the error of axis a (east, north, up) [m], sigma_ia what the filter's covariance says of it, z = e/sigma,
    phi and Phi of the standard normal, over the N rows that are the first counted one of a second::

        position_crps_m = 1/(3 N) sum sigma (z (2 Phi(z) - 1) + 2 phi(z) - 1/sqrt(pi))

    A proper score, as `log_score` is, but in metres, and a single error that the filter had ruled out does not decide
    it. NaN without a row, or where a variance is negative.

    Source: Gneiting and Raftery, "Strictly proper scoring rules, prediction, and estimation", JASA 102 (2007), (21).
    """

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the value by column name."""
        return self.summarise(sums_of(estimate, recording, counted))

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the same from the sums of a run."""
        error, variance = sums.sampled_m, sums.sampled_m2[:, [0, 3, 5]]
        if len(error) == 0 or not (variance >= 0).all():
            return {"position_crps_m": np.nan}
        with np.errstate(over="ignore", invalid="ignore"):
            return {"position_crps_m": float(np.mean(crps(error, np.sqrt(variance))))}
