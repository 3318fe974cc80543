"""Comparisons of runs of which no two have a seed in common: the same statements, from two samples each."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.evaluation.statistics.families import LEAST_SEEDS, max_t_of_two, standard_errors, studentised
from jerkbench.evaluation.statistics.judgement import LEVEL, MARGIN, Judgement, judgement_of, middle
from jerkbench.evaluation.statistics.over_seeds import LOCKED_OUT


@dataclass(frozen=True, eq=False)
class TwoSamples:
    """The errors of a and of b, each on seeds of its own.

    Attributes:
        a: (n,) infinite where the run was lost.
        b: (k,) likewise.
    """

    a: FloatArray
    b: FloatArray

    @cached_property
    def failed(self) -> tuple[BoolArray, BoolArray]:
        """Which runs of either were lost, or are `LOCKED_OUT` times the median."""
        return _failed(self.a), _failed(self.b)

    @property
    def failures(self) -> tuple[int, int]:
        """Runs that a, and that b, lost or locked out in."""
        return int(self.failed[0].sum()), int(self.failed[1].sum())

    @property
    def sizes(self) -> tuple[int, int]:
        """Seeds of a, and of b."""
        return len(self.a), len(self.b)

    @property
    def n(self) -> int:
        """Seeds of the smaller sample."""
        return min(self.sizes)

    @property
    def plain(self) -> bool:
        """Whether every run went well, and means may stand for them."""
        positive = bool((self.a > 0).all() and (self.b > 0).all())
        return positive and not (self.failed[0].any() or self.failed[1].any())


def two_samples(a: npt.ArrayLike, b: npt.ArrayLike) -> TwoSamples:
    """Return the samples without what is NaN (the metric did not apply) or negative."""
    first, second = (np.asarray(values, dtype=np.float64) for values in (a, b))
    return TwoSamples(first[first >= 0], second[second >= 0])


def judged_on_other_seeds(
    comparisons: Sequence[TwoSamples], margin: float = MARGIN, level: float = LEVEL
) -> list[Judgement]:
    """Judge comparisons of runs on other seeds as one family, as `judged` does those on the same.

    The difference of the mean logarithms, with Welch's standard error and the critical value of `max_t_of_two`. Where
    runs were lost or locked out the medians are tested by Mood's test and the losses by Fisher's exact one, with
    Bonferroni's correction for both; there is no interval, and "equal" is not claimed. Much less can be shown than on
    the same seeds.

    Source: Mood, "Introduction to the Theory of Statistics", McGraw-Hill (1950), 16.4; Fisher, "The logic of inductive
    inference", J. Royal Statist. Soc. 98 (1935).
    """
    total = max(1, sum(samples.n >= LEAST_SEEDS for samples in comparisons))
    p = np.ones((len(comparisons), 2))
    critical = np.full(len(comparisons), np.nan)
    for places in _of_each_size(comparisons).values():
        a, b = (np.log(np.stack([getattr(comparisons[k], name) for k in places])) for name in ("a", "b"))
        largest = dataclasses.replace(max_t_of_two(a, b), share=len(places) / total)
        distance, error = np.abs(a.mean(axis=1) - b.mean(axis=1)), np.hypot(standard_errors(a), standard_errors(b))
        p[places, 0], critical[places] = largest.p(studentised(distance, error)), largest.critical(level)
    for k, samples in enumerate(comparisons):
        if not samples.plain and samples.n >= LEAST_SEEDS:
            p[k] = np.minimum(1.0, 2 * total * np.array([_medians_p(samples), _exact_p(*samples.failed)]))
    return [
        judgement_of(_interval(samples, c), (p[k, 0], p[k, 1]), samples, critical=c, margin=margin, level=level)
        for k, (samples, c) in enumerate(zip(comparisons, critical.tolist(), strict=True))
    ]


def _interval(samples: TwoSamples, critical: float) -> tuple[float, float, float]:
    """Return the difference of the mean logarithms with its interval; of medians without one."""
    if samples.n == 0:
        return np.nan, np.nan, np.nan
    with np.errstate(divide="ignore"):
        logs = np.log(samples.a), np.log(samples.b)
    if not samples.plain:
        first, second = (middle(np.sort(values)) for values in logs)
        return (0.0 if first == second else first - second), np.nan, np.nan
    centre = float(logs[0].mean() - logs[1].mean())
    if not np.isfinite(critical):
        return centre, centre - critical, centre + critical
    half = critical * float(np.hypot(*(standard_errors(values[None])[0] for values in logs)))
    return centre, centre - half, centre + half


def _failed(errors: FloatArray) -> BoolArray:
    """Return which errors are infinite, or many times the median of the finite ones."""
    finite = errors[np.isfinite(errors)]
    return errors > LOCKED_OUT * np.median(finite) if len(finite) else np.isinf(errors)


def _of_each_size(comparisons: Sequence[TwoSamples]) -> dict[tuple[int, int], list[int]]:
    """Return the places of the comparisons whose runs all went well, by their numbers of seeds."""
    sizes: dict[tuple[int, int], list[int]] = {}
    for k, samples in enumerate(comparisons):
        if samples.plain and samples.n >= LEAST_SEEDS:
            sizes.setdefault((len(samples.a), len(samples.b)), []).append(k)
    return sizes


def _medians_p(samples: TwoSamples) -> float:
    """Return the p of Mood's median test: who has more runs above the common median."""
    common = middle(np.sort(np.concatenate([samples.a, samples.b])))
    return _exact_p(samples.a > common, samples.b > common)


def _exact_p(a: BoolArray, b: BoolArray) -> float:
    """Return Fisher's exact p that the shares are the same."""
    from scipy.stats import fisher_exact

    table = [[int(a.sum()), int((~a).sum())], [int(b.sum()), int((~b).sum())]]
    return float(fisher_exact(table).pvalue)
