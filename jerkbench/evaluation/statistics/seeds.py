"""Seeds: how many a verdict needs, looks at more of them, a choice judged on others, runs without common ones."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.evaluation.statistics.families import LEAST_SEEDS, max_t_of_two, standard_errors, studentised
from jerkbench.evaluation.statistics.judgement import LEVEL, MARGIN, Judgement, judgement_of
from jerkbench.evaluation.statistics.over_seeds import TwoSamples, middles

POWER = 0.8
"""So likely is it, at least, that so many seeds decide."""

CAUTION = 0.8
"""The scatter that is planned with is larger than the true one in so many cases."""

MOST = 10_000
"""More seeds than these nobody runs: none are named."""


def seeds_needed(d: FloatArray, comparisons: int = 1, level: float = 0.05, critical: float = np.nan) -> int | None:
    """Return how many seeds show that a and b differ; None where they may be equal, and over `MOST`.

    Of N seeds the mean falls at mu + s Z/sqrt(N), and decides where it is more than c standard errors from 0. The
    answer is the smallest N, of the grid 1.05^k, that does so with a probability of at least `POWER` wherever in the
    95 % interval of the mean that was seen mu lies; an interval with 0 in it has none. s is the upper `CAUTION` bound
    of the standard deviation, c that of `critical_t`, as many times as large as ``critical`` is of theirs: a study
    whose comparisons go together asks for less, a heavy tail for more.

    Args:
        d: (n,) log ratios of the seeds that went well; at least two.
        comparisons: of the whole study.
        level: of the whole study.
        critical: |t| that the n seeds had to reach; without it, or where none is enough, that of `critical_t`.
    """
    from scipy.special import chdtri, ndtri, stdtrit

    n, s, mean = len(d), float(np.std(d, ddof=1)), abs(float(d.mean()))
    nearest = mean - float(stdtrit(n - 1, 0.975)) * s / np.sqrt(n)
    if nearest <= 0:
        return None
    if np.ptp(d) == 0:
        return n
    sizes = _sizes()
    sizes = sizes[sizes > n]
    planned = critical_t(np.append(n, sizes), comparisons, level)
    c = planned[1:] * (critical / planned[0] if np.isfinite(critical) else 1.0)
    error = s * np.sqrt((n - 1) / chdtri(n - 1, CAUTION)) / np.sqrt(sizes)
    enough = np.flatnonzero(nearest / error - c >= ndtri(POWER))
    return int(sizes[enough[0]]) if len(enough) else None


def critical_t(n: FloatArray, comparisons: int, level: float) -> FloatArray:
    """Return about how large the critical |t| of `max_t` is for (k,) numbers of seeds and normal log ratios.

    Bonferroni's Student quantile, wider by 1 + (8 + 7 log m)/n^2: fitted to the bootstrap's of 6 to 50 seeds and
    1 to 180 comparisons, to plan with; no verdict uses it.
    """
    from scipy.special import stdtrit

    wider = 1 + (8 + 7 * np.log(comparisons)) / n**2
    return np.asarray(stdtrit(n - 1, 1 - level / (2 * comparisons)) * wider, dtype=np.float64)


@lru_cache(maxsize=1)
def _sizes() -> FloatArray:
    return np.unique(np.ceil(6 * 1.05 ** np.arange(np.ceil(np.log(MOST / 6) / np.log(1.05)))))


# Seeds added in blocks until everything is decided: the level that each look at the results may spend.

FIRST = 20
"""Seeds before the first look: fewer decide little, as the bootstrap of many comparisons is wide."""


def looks(most: int, first: int = FIRST) -> list[int]:
    """Return the numbers of seeds at which one looks: ``first``, twice as many each time, ``most`` at the end.

    >>> looks(400)
    [20, 40, 80, 160, 320, 400]
    """
    sizes = []
    size = first
    while size < most:
        sizes.append(size)
        size *= 2
    return [*sizes, most]


def levels(sizes: list[int], level: float = 0.05) -> FloatArray:
    """Return the level (k,) of each look at ``sizes`` seeds; together they spend ``level`` and no more.

    With t the share of the seeds of the last look, alpha(t) = level log(1 + (e - 1) t) is spent by each look; its own
    level is what the look adds. The sum, not the joint distribution of the looks, holds the level: that is valid for
    the largest of many comparisons as well, of which different ones may be the largest at different looks.

    Source: Lan and DeMets, "Discrete sequential boundaries for clinical trials", Biometrika 70 (1983), Pocock's type.
    """
    t = np.asarray(sizes, dtype=np.float64) / sizes[-1]
    spent = level * np.log1p((np.e - 1) * t)
    return np.diff(spent, prepend=0.0)


# The winner's curse: what the best of several settings is worth on seeds that did not choose it.


def chosen_on_other_seeds(errors: FloatArray) -> IntArray:
    """Return (n,) which of k settings the other seeds choose for each seed, by (k, n) errors.

    The lowest mean log is the best; a setting with fewer lost (infinite) runs goes before. Of one seed there is no
    other: it chooses for itself.

    Source: Stone, "Cross-validatory choice and assessment of statistical predictions", JRSS B 36 (1974).
    """
    lost = np.isinf(errors)
    logs = np.log(np.where(lost, 1.0, np.maximum(errors, np.finfo(float).tiny)))
    lost_by, total, count = (of.sum(axis=1, keepdims=True) for of in (lost, logs, ~lost))
    if errors.shape[1] < 2:
        return _best(lost_by, total, count)
    return _best(lost_by - lost, total - logs, count - ~lost)


def _best(lost: FloatArray, total: FloatArray, count: FloatArray) -> IntArray:
    """Return (n,) the setting with the fewest lost runs, and of these the lowest mean log."""
    mean = total / np.maximum(1, count)
    candidates = np.where(lost == lost.min(axis=0), mean, np.inf)
    return np.asarray(np.argmin(candidates, axis=0), dtype=np.int64)


# Comparisons of runs of which no two have a seed in common: the same statements, from two samples each.


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
    sizes: dict[tuple[int, int], list[int]] = {}  # the places of those whose runs all went well
    for k, samples in enumerate(comparisons):
        if samples.plain and samples.n >= LEAST_SEEDS:
            sizes.setdefault(samples.sizes, []).append(k)
    for places in sizes.values():
        a, b = (np.log(np.stack([getattr(comparisons[k], name) for k in places])) for name in ("a", "b"))
        largest = max_t_of_two(a, b)._replace(share=len(places) / total)
        distance, error = np.abs(a.mean(axis=1) - b.mean(axis=1)), np.hypot(standard_errors(a), standard_errors(b))
        p[places, 0], critical[places] = largest.p(studentised(distance, error)), largest.critical(level)
    for k, samples in enumerate(comparisons):
        if not samples.plain and samples.n >= LEAST_SEEDS:
            # who has more runs above the common median
            common = middles(np.sort(np.concatenate([samples.a, samples.b]))[None])[0]
            medians_p = _exact_p(samples.a > common, samples.b > common)
            p[k] = np.minimum(1.0, 2 * total * np.array([medians_p, _exact_p(*samples.failed)]))
    return [
        judgement_of(np.array(_interval(samples, c)), p[k], samples, c, margin, level)
        for k, (samples, c) in enumerate(zip(comparisons, critical.tolist(), strict=True))
    ]


def _interval(samples: TwoSamples, critical: float) -> tuple[float, float, float]:
    """Return the difference of the mean logarithms with its interval; of medians without one."""
    if samples.n == 0:
        return np.nan, np.nan, np.nan
    with np.errstate(divide="ignore"):
        logs = np.log(samples.a), np.log(samples.b)
    if not samples.plain:
        first, second = (float(middles(np.sort(values)[None])[0]) for values in logs)
        return (0.0 if first == second else first - second), np.nan, np.nan
    centre = float(logs[0].mean() - logs[1].mean())
    if not np.isfinite(critical):
        return centre, centre - critical, centre + critical
    half = critical * float(np.hypot(*(standard_errors(values[None])[0] for values in logs)))
    return centre, centre - half, centre + half


def _exact_p(a: BoolArray, b: BoolArray) -> float:
    """Return Fisher's exact p that the shares are the same."""
    from scipy.stats import fisher_exact

    table = [[int(a.sum()), int((~a).sum())], [int(b.sum()), int((~b).sum())]]
    return float(fisher_exact(table).pvalue)
