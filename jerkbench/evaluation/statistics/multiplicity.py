"""The p of a study's comparisons, corrected for all of them together."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.evaluation.statistics.exact_tests import median_p, sign_p
from jerkbench.evaluation.statistics.log_ratio import LogRatios
from jerkbench.evaluation.statistics.max_t import max_t, standard_errors, studentised
from jerkbench.evaluation.statistics.samples import Samples

LEAST_SEEDS = 6
"""Of fewer seeds nothing is decided: no exact test reaches 5 %, and too few different resamples can be drawn."""


class Correction(StrEnum):
    """What 5 % are 5 % of."""

    MAX_T = "max_t"
    """Of studies that have any wrong sentence."""

    FDR = "fdr"
    """Of sentences."""


@dataclass(frozen=True, eq=False)
class Family:
    """The p of m comparisons, and what their intervals have to reach for the same verdicts.

    Attributes:
        differ: (m,) that a and b differ; NaN without a seed, 1 of fewer than `LEAST_SEEDS`.
        lost: (m,) that either loses more runs.
        critical: (m,) beyond which |t| on a mean differs; NaN of a median, and of fewer than `LEAST_SEEDS`.
        confidence: of the interval of a median.
    """

    differ: FloatArray
    lost: FloatArray
    critical: FloatArray
    confidence: float


def family(comparisons: Sequence[LogRatios], correction: Correction, level: float) -> Family:
    """Return the corrected p of the comparisons."""
    return (_false_discovery if correction is Correction.FDR else _whole_study)(comparisons, level)


def _whole_study(comparisons: Sequence[LogRatios], level: float) -> Family:
    """By `max_t` of the means; Bonferroni for the exact tests, and between numbers of seeds."""
    total = max(1, sum(ratios.n >= LEAST_SEEDS for ratios in comparisons))
    exact = 2 * total  # of a comparison with lost runs there are two tests: of the errors, and of the losses
    differ, lost = (np.minimum(1.0, exact * p) for p in _uncorrected(comparisons))
    critical = np.full(len(comparisons), np.nan)
    for places, d in _of_each_size(comparisons):
        largest = dataclasses.replace(max_t(d), share=len(places) / total)
        differ[places], critical[places] = largest.p(_t(d)), largest.critical(level)
    return Family(differ, lost, critical, 1 - level / exact)


def _false_discovery(comparisons: Sequence[LogRatios], level: float) -> Family:
    """By Benjamini and Hochberg; the R differences that are found of m comparisons have intervals at 1 - R level/m.

    Source: Benjamini and Yekutieli, "False discovery rate-adjusted multiple confidence intervals for selected
    parameters", JASA 100 (2005).
    """
    from scipy.special import stdtrit

    differ, lost = map(_adjusted, _uncorrected(comparisons))
    each = level * max(1, int((differ < level).sum())) / max(1, int((~np.isnan(differ)).sum()))
    critical = np.full(len(comparisons), np.nan)
    for places, d in _of_each_size(comparisons):
        critical[places] = stdtrit(d.shape[1] - 1, 1 - each / 2)
    return Family(differ, lost, critical, 1 - each)


def _uncorrected(comparisons: Sequence[LogRatios]) -> tuple[FloatArray, FloatArray]:
    """By Student's t of the means, and the exact tests where runs were lost or locked out."""
    from scipy.special import stdtr

    differ, lost = (np.ones(len(comparisons)) for _ in range(2))
    for k, ratios in enumerate(comparisons):
        if ratios.n == 0:
            differ[k] = lost[k] = np.nan
        elif not ratios.plain and ratios.n >= LEAST_SEEDS:
            failed = ratios.lost | ratios.locked
            differ[k] = median_p(ratios.d)
            lost[k] = sign_p(*(failed & ~failed[:, ::-1]).sum(axis=0).tolist())
    for places, d in _of_each_size(comparisons):
        differ[places] = 2 * stdtr(d.shape[1] - 1, -_t(d))
    return differ, lost


def _t(d: FloatArray) -> FloatArray:
    """Return how many standard errors each mean is away from 0."""
    return studentised(np.abs(d.mean(axis=1)), standard_errors(d))


def _of_each_size(comparisons: Sequence[LogRatios]) -> list[tuple[IntArray, FloatArray]]:
    """Return places and log ratios of comparisons whose runs went well, by number of seeds, where that is enough."""
    known = [k for k, ratios in enumerate(comparisons) if ratios.plain and ratios.n >= LEAST_SEEDS]
    samples = Samples.of([comparisons[k].d for k in known])
    return [(np.array(known)[places], d) for places, d in samples.by_size()]


def _adjusted(p: FloatArray) -> FloatArray:
    from scipy.stats import false_discovery_control

    adjusted = np.full_like(p, np.nan)
    known = ~np.isnan(p)
    if known.any():
        adjusted[known] = false_discovery_control(p[known])
    return adjusted
