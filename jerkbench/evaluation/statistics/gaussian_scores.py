"""Scores of a Gaussian estimate that reward accuracy and honesty together."""

import numpy as np

from jerkbench.arrays import FloatArray


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


def non_credibility_index(nees: FloatArray, ideal: FloatArray) -> float:
    """Return the non-credibility index [dB] of (n,) NEES, beside those (n,) with the true mean square errors.

    ::

        NCI = 10/n sum |log10(nees_i/ideal_i)|

    0 is credible; 10 says that the covariances are wrong by a factor of ten on average, either way.

    Source: Li, Zhao and Li, "Estimator's credibility and its measures", IFAC World Congress (2002).
    """
    known = (nees > 0) & (ideal > 0) & np.isfinite(nees) & np.isfinite(ideal)
    return float(10 * np.mean(np.abs(np.log10(nees[known] / ideal[known])))) if known.any() else np.nan


def inclination_indicator(nees: FloatArray, ideal: FloatArray) -> float:
    """Return the inclination indicator [dB]: the same without the absolute value, above 0 overconfident.

    Source: Li, Zhao and Li, as above.
    """
    known = (nees > 0) & (ideal > 0) & np.isfinite(nees) & np.isfinite(ideal)
    return float(10 * np.mean(np.log10(nees[known] / ideal[known]))) if known.any() else np.nan
