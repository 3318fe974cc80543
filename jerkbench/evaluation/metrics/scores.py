"""Proper scores of a Gaussian estimate: CRPS, log score and credibility."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.sums import Summed
from jerkbench.plugins import register
from jerkbench.sums import Sums


@register("metric", "log_score")
@dataclass(frozen=True)
class LogScore(Summed):
    """Mean negative log-density of the true position under the filter's own Gaussian; the lowest is the best.

    With e_i the position error [m] and P_i its covariance [m2], over the N rows that are the first counted one of a
    second::

        position_log_score = 1/(2 N) sum (e_i' P_i^-1 e_i + log det P_i + 3 log 2 pi)         [nats, of metres]

    It is a proper score: no filter can improve it by claiming another covariance than that of its errors. Where the
    reference is made of withheld fixes, it is the score of the predicted measurement. NaN without a row, or where a
    covariance is not positive definite.

    Source: Gneiting and Raftery, "Strictly proper scoring rules, prediction, and estimation", JASA 102 (2007).
    """

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the value by column name."""
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


# Scores of a Gaussian estimate that reward accuracy and honesty together.


def crps(error: FloatArray, sigma: FloatArray) -> FloatArray:
    """Return the continuous ranked probability score of Gaussians that are wrong by ``error``, in its unit.

    With z = error/sigma, phi and Phi of the standard normal::

        CRPS = sigma (z (2 Phi(z) - 1) + 2 phi(z) - 1/sqrt(pi))

    Without a sigma it is |error|. The lowest is the best; 0.234 sigma is the least that a sigma promises.

    Source: Gneiting and Raftery, "Strictly proper scoring rules, prediction, and estimation", JASA 102 (2007), (21).
    """
    from scipy.special import ndtr

    certain = sigma == 0
    z = error / np.where(certain, 1.0, sigma)
    density = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)
    score = sigma * (z * (2 * ndtr(z) - 1) + 2 * density - 1 / np.sqrt(np.pi))
    return np.asarray(np.where(certain, np.abs(error), score), dtype=np.float64)


def credibility(nees: FloatArray, ideal: FloatArray) -> tuple[float, float]:
    """Return two indices [dB] of (n,) NEES, beside those (n,) with the true mean square errors.

    ::

        NCI = 10/n sum |log10(nees_i/ideal_i)|

    The non-credibility index NCI: 0 is credible; 10 says that the covariances are wrong by a factor of ten on average,
    either way. The inclination indicator is the same without the absolute value, above 0 overconfident.

    Source: Li, Zhao and Li, "Estimator's credibility and its measures", IFAC World Congress (2002).
    """
    known = (nees > 0) & (ideal > 0) & np.isfinite(nees) & np.isfinite(ideal)
    logs = np.log10(nees[known] / ideal[known])
    return (float(10 * np.mean(np.abs(logs))), float(10 * np.mean(logs))) if known.any() else (np.nan, np.nan)


# The continuous ranked probability score of the position: metres, and honesty rewarded.


@register("metric", "crps")
@dataclass(frozen=True)
class Crps(Summed):
    """Mean continuous ranked probability score of the filter's own Gaussian of the position; the lowest is the best.

    With e_ia the error of axis a (east, north, up) [m], sigma_ia what the filter's covariance says of it, z = e/sigma,
    phi and Phi of the standard normal, over the N rows that are the first counted one of a second::

        position_crps_m = 1/(3 N) sum sigma (z (2 Phi(z) - 1) + 2 phi(z) - 1/sqrt(pi))

    A proper score, as `log_score` is, but in metres, and a single error that the filter had ruled out does not decide
    it. NaN without a row, or where a variance is negative.

    Source: Gneiting and Raftery, "Strictly proper scoring rules, prediction, and estimation", JASA 102 (2007), (21).
    """

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the value by column name."""
        error, variance = sums.sampled_m, sums.sampled_m2[:, [0, 3, 5]]
        if len(error) == 0 or not (variance >= 0).all():
            return {"position_crps_m": np.nan}
        with np.errstate(over="ignore", invalid="ignore"):
            return {"position_crps_m": float(np.mean(crps(error, np.sqrt(variance))))}


# The non-credibility index: by how many decibels the covariances are wrong.


@register("metric", "credibility")
@dataclass(frozen=True)
class Credibility(Summed):
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

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the two values by column name."""
        error = sums.sampled_m
        square = error.T @ error / max(1, len(error))
        if len(error) < 4 or not np.isfinite(square).all() or np.linalg.matrix_rank(square) < 3:
            return {"non_credibility_db": np.nan, "inclination_db": np.nan}
        nees = _squares(error, sums.sampled_covariance_m2)
        ideal = _squares(error, np.broadcast_to(square, (len(error), 3, 3)))
        return dict(zip(("non_credibility_db", "inclination_db"), credibility(nees, ideal), strict=True))


def _squares(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return (k,) e' P^-1 e; NaN where a covariance is not positive definite."""
    definite = np.linalg.eigvalsh(covariance)[:, 0] > 0
    solvable = np.where(definite[:, None, None], covariance, np.eye(3))
    white = np.linalg.solve(solvable, error[:, :, None])[:, :, 0]
    return np.where(definite, np.sum(error * white, axis=1), np.nan)
