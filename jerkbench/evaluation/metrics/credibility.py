"""The non-credibility index: by how many decibels the covariances are wrong."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.statistics.gaussian_scores import inclination_indicator, non_credibility_index
from jerkbench.evaluation.sums import sums_of
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.sums import Sums


@register("metric", "credibility")
@dataclass(frozen=True)
class Credibility:
    """Non-credibility index and inclination indicator of the position.

    With e_i the position error, P_i its covariance and S = 1/N sum e_i e_i' over the N rows that are the first counted
    one of a second, which stands for the true mean square error::

        rho_i = e_i' P_i^-1 e_i / (e_i' S^-1 e_i)
        non_credibility_db = 10/N sum |log10 rho_i|     0 is credible, 10 a factor of ten either way
        inclination_db     = 10/N sum log10 rho_i       above 0 overconfident, below it too cautious

    A single large error does not decide them, as it does ANEES. S is over the rows of one run, not over runs at one
    time: where the errors grow and shrink within a run, some of the index is that. NaN of fewer than four rows. Not
    computed unless asked for: ``metrics=[credibility]``.

    Source: Li, Zhao and Li, "Estimator's credibility and its measures", IFAC World Congress (2002).
    """

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the two values by column name."""
        return self.summarise(sums_of(estimate, recording, counted))

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the same from the sums of a run."""
        error = sums.sampled_m
        square = error.T @ error / max(1, len(error))
        if len(error) < 4 or not np.isfinite(square).all() or np.linalg.matrix_rank(square) < 3:
            return {"non_credibility_db": np.nan, "inclination_db": np.nan}
        nees = _squares(error, sums.sampled_covariance_m2)
        ideal = _squares(error, np.broadcast_to(square, (len(error), 3, 3)))
        return {
            "non_credibility_db": non_credibility_index(nees, ideal),
            "inclination_db": inclination_indicator(nees, ideal),
        }


def _squares(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return (k,) e' P^-1 e; NaN where a covariance is not positive definite."""
    definite = np.linalg.eigvalsh(covariance)[:, 0] > 0
    solvable = np.where(definite[:, None, None], covariance, np.eye(3))
    white = np.linalg.solve(solvable, error[:, :, None])[:, :, 0]
    return np.where(definite, np.sum(error * white, axis=1), np.nan)
