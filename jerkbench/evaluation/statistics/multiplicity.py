"""The p of a study's comparisons, corrected for all of them together."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.statistics.exact_tests import equal_median_p, rare_p, sign_p
from jerkbench.evaluation.statistics.log_ratio import LogRatios
from jerkbench.evaluation.statistics.max_t import max_t, standard_errors, studentised

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
    """The p of m comparisons.

    Attributes:
        differ: (m,) that a and b differ; NaN without a seed, 1 of fewer than `LEAST_SEEDS`.
        equal: (m,) that they are equal within the margin.
        lost: (m,) that either loses more runs.
        critical: (m,) beyond which |t| on a mean differs; NaN without a family-wise test of it.
    """

    differ: FloatArray
    equal: FloatArray
    lost: FloatArray
    critical: FloatArray


def family(comparisons: Sequence[LogRatios], margin: float, correction: Correction, level: float) -> Family:
    """Return the corrected p of the comparisons; ``margin`` is that of the log ratio."""
    if correction is Correction.FDR:
        return _false_discovery(_uncorrected(comparisons, margin))
    return _whole_study(comparisons, margin, level)


def _whole_study(comparisons: Sequence[LogRatios], margin: float, level: float) -> Family:
    """By `max_t` of the means; Bonferroni for the exact tests, and between numbers of seeds."""
    alone = _uncorrected(comparisons, margin)
    total = max(1, sum(ratios.n >= LEAST_SEEDS for ratios in comparisons))
    exact = 2 * total  # of a comparison with lost runs there are two tests: of the errors, and of the losses
    differ, equal, lost = (np.minimum(1.0, exact * p) for p in (alone.differ, alone.equal, alone.lost))
    critical = np.full(len(comparisons), np.nan)
    for places in _of_each_size(comparisons).values():
        d = np.stack([comparisons[k].d for k in places])
        largest = dataclasses.replace(max_t(d), share=len(places) / total)
        t, t_equal = _statistics(d, margin)
        differ[places], equal[places] = largest.p(t), largest.p(t_equal)
        critical[places] = largest.critical(level)
    return Family(differ, equal, lost, critical)


def _uncorrected(comparisons: Sequence[LogRatios], margin: float) -> Family:
    """By Student's t of the means, and the exact tests where runs were lost or locked out."""
    differ, equal, lost = (np.ones(len(comparisons)) for _ in range(3))
    for k, ratios in enumerate(comparisons):
        if ratios.n == 0:
            differ[k] = equal[k] = lost[k] = np.nan
        elif not ratios.plain and ratios.n >= LEAST_SEEDS:
            differ[k] = sign_p(int((ratios.d < 0).sum()), int((ratios.d > 0).sum()))
            equal[k] = _equal_p(ratios, margin)
            lost[k] = sign_p(*_failed_alone(ratios))
    for n, places in _of_each_size(comparisons).items():
        t, t_equal = _statistics(np.stack([comparisons[k].d for k in places]), margin)
        differ[places], equal[places] = 2 * _student_tail(t, n), _student_tail(t_equal, n)
    return Family(differ, equal, lost, np.full(len(comparisons), np.nan))


def _equal_p(ratios: LogRatios, margin: float) -> float:
    """Return the p that the medians are equal, and the runs that either alone failed in fewer than the margin."""
    alone = _failed_alone(ratios)
    medians = equal_median_p(ratios.d, margin)
    return medians if alone[0] == alone[1] else max(medians, rare_p(sum(alone), ratios.n, -np.expm1(-margin)))


def _failed_alone(ratios: LogRatios) -> tuple[int, int]:
    """Return how many runs a alone, and b alone, lost or locked out in."""
    failed = ratios.lost | ratios.locked
    return int((failed[:, 0] & ~failed[:, 1]).sum()), int((failed[:, 1] & ~failed[:, 0]).sum())


def _statistics(d: FloatArray, margin: float) -> tuple[FloatArray, FloatArray]:
    """Return how many standard errors each mean is away from 0, and inside the nearer end of the margin."""
    mean, error = np.abs(d.mean(axis=1)), standard_errors(d)
    return studentised(mean, error), studentised(np.maximum(0.0, margin - mean), error)


def _student_tail(t: FloatArray, n: int) -> FloatArray:
    from scipy.special import stdtr

    return np.asarray(stdtr(n - 1, -t), dtype=np.float64)


def _of_each_size(comparisons: Sequence[LogRatios]) -> dict[int, list[int]]:
    """Return the places of the comparisons whose runs went well, by their number of seeds, where that is enough."""
    sizes: dict[int, list[int]] = {}
    for k, ratios in enumerate(comparisons):
        if ratios.plain and ratios.n >= LEAST_SEEDS:
            sizes.setdefault(ratios.n, []).append(k)
    return sizes


def _false_discovery(alone: Family) -> Family:
    """Return Benjamini and Hochberg's correction of each p."""
    return Family(_adjusted(alone.differ), _adjusted(alone.equal), _adjusted(alone.lost), alone.critical)


def _adjusted(p: FloatArray) -> FloatArray:
    from scipy.stats import false_discovery_control

    adjusted = np.full_like(p, np.nan)
    known = ~np.isnan(p)
    if known.any():
        adjusted[known] = false_discovery_control(p[known])
    return adjusted
