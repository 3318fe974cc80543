"""NEES and NIS against chi-square: the band in which the average of a consistent filter lies, and the verdict."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.blocks import correlation_rows

CONSISTENT, OVERCONFIDENT, CAUTIOUS, UNKNOWN = "consistent", "overconfident", "too cautious", "not known"


@dataclass(frozen=True)
class Verdict:
    """An average with the band in which a consistent filter's lies.

    Attributes:
        average: of what was judged.
        low: lower end of the band.
        high: upper end.
        word: "consistent", "overconfident" (above the band), "too cautious" (below), or "not known".
    """

    average: float
    low: float
    high: float
    word: str


def chi2_band(dof: float, samples: float, confidence: float = 0.95) -> tuple[float, float]:
    """Return the band of the average of ``samples`` independent chi-square values of ``dof`` degrees each.

    Source: Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation", 5.4.
    """
    from scipy.stats import chi2

    low, high = chi2.ppf([(1 - confidence) / 2, (1 + confidence) / 2], dof * samples) / samples
    return float(low), float(high)


def nis_verdict(nis: FloatArray, rows: FloatArray, confidence: float = 0.95) -> Verdict:
    """Judge (m,) NIS of updates with (m,) rows each, per row on average; a consistent filter has them independent."""
    there = (rows > 0) & np.isfinite(nis)
    total = float(np.sum(rows[there]))
    if total == 0:
        return Verdict(np.nan, np.nan, np.nan, UNKNOWN)
    return _judged(float(np.sum(nis[there])) / total, *chi2_band(1, total, confidence))


def nees_verdict(nees: FloatArray, dof: int, confidence: float = 0.95) -> Verdict:
    """Judge (runs, k) NEES of ``dof`` degrees at the same k times.

    Errors of one run follow each other: k times count for k divided by the correlation time of the NEES over the runs'
    mean, so that the band is as wide as the runs deserve.
    """
    if nees.size == 0 or not np.isfinite(nees).all():
        return Verdict(np.nan, np.nan, np.nan, UNKNOWN)
    independent = sum(nees.shape[1] / correlation_rows(run) for run in nees)
    return _judged(float(nees.mean()), *chi2_band(dof, independent, confidence))


def runs_verdict(averages: npt.ArrayLike, expected: float, confidence: float = 0.95) -> Verdict:
    """Judge (n,) averages of independent runs by Student's interval around ``expected``; of one run nothing is known.

    The band is that of the mean of n such runs if they were consistent, with the spread that they have.
    """
    from scipy.stats import t

    values = np.asarray(averages, dtype=np.float64)
    values = values[np.isfinite(values)]
    if len(values) < 2:
        return Verdict(float(values.mean()) if len(values) else np.nan, np.nan, np.nan, UNKNOWN)
    half = float(t.ppf((1 + confidence) / 2, len(values) - 1)) * float(values.std(ddof=1)) / np.sqrt(len(values))
    return _judged(float(values.mean()), expected - half, expected + half)


def _judged(average: float, low: float, high: float) -> Verdict:
    word = OVERCONFIDENT if average > high else CAUTIOUS if average < low else CONSISTENT
    return Verdict(average, low, high, word)
