"""The log score: the likelihood of the truth under the filter, accuracy and honesty in one number."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.sums import sums_of
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.sums import Sums


@register("metric", "log_score")
@dataclass(frozen=True)
class LogScore:
    """Mean negative log-density of the true position under the filter's own Gaussian; the lowest is the best.

    With e_i the position error [m] and P_i its covariance [m2], over the N rows that are the first counted one of a
    second::

        position_log_score = 1/(2 N) sum (e_i' P_i^-1 e_i + log det P_i + 3 log 2 pi)         [nats, of metres]

    It is a proper score: no filter can improve it by claiming another covariance than that of its errors. Where the
    reference is made of withheld fixes, it is the score of the predicted measurement. NaN without a row, or where a
    covariance is not positive definite.

    Source: Gneiting and Raftery, "Strictly proper scoring rules, prediction, and estimation", JASA 102 (2007).
    """

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the value by column name."""
        return self.summarise(sums_of(estimate, recording, counted))

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the same from the sums of a run."""
        return {"position_log_score": _mean_score(sums.sampled_m, sums.sampled_covariance_m2)}


def _mean_score(error: FloatArray, covariance: FloatArray) -> float:
    if len(error) == 0:
        return np.nan
    try:
        root = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        return np.nan
    white = np.linalg.solve(root, error[:, :, None])[:, :, 0]
    log_det = 2 * np.sum(np.log(np.diagonal(root, axis1=1, axis2=2)), axis=1)
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.mean(np.sum(white**2, axis=1) + log_det + 3 * np.log(2 * np.pi)) / 2)
