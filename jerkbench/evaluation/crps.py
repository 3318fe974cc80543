"""The continuous ranked probability score of the position: metres, and honesty rewarded."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import known, position_error_m
from jerkbench.evaluation.statistics.gaussian_scores import crps
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("metric", "crps")
@dataclass(frozen=True)
class Crps:
    """Mean continuous ranked probability score of the filter's own Gaussian of the position; the lowest is the best.

    With e_ia the error of axis a (east, north, up) [m], sigma_ia what the filter's covariance says of it, z = e/sigma,
    phi and Phi of the standard normal, over the N counted rows::

        position_crps_m = 1/(3 N) sum sigma (z (2 Phi(z) - 1) + 2 phi(z) - 1/sqrt(pi))

    A proper score, as `log_score` is, but in metres, and a single error that the filter had ruled out does not decide
    it. NaN without a row, or where a variance is negative. Not computed unless asked for: ``metrics=[crps]``.

    Source: Gneiting and Raftery, "Strictly proper scoring rules, prediction, and estimation", JASA 102 (2007), (21).
    """

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the value by column name."""
        rows = counted & known(recording.reference.enu_m, estimate)
        error = position_error_m(estimate, recording)[rows]
        variance = np.diagonal(estimate.covariance[rows, :3, :3], axis1=1, axis2=2)
        if len(error) == 0 or not (variance >= 0).all():
            return {"position_crps_m": np.nan}
        with np.errstate(over="ignore", invalid="ignore"):
            return {"position_crps_m": float(np.mean(crps(error, np.sqrt(variance))))}
