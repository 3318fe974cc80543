"""Comparison of methods over random drives and independent tunings, and over several scenarios.

Methods with an adaptation are compared with plain filters over drives and tunings. Each method was tuned R times, and
each tuned method was evaluated on the same D drives. A plain filter has no adaptation and was tuned in the same way.
y_rd is the difference between the log errors of the method and of a plain filter in tuning r on drive d. The effects
a_r of tunings and b_d of drives are random and crossed::

    y_rd = mu + a_r + b_d + e_rd,    ratio = exp(mu)

Drive d has the weight w_d, and the weights sum to 1. The following estimates use S_k = sum_d w_d^k and c = S_2/(S_2 - 2
S_3 + S_2^2)::

    mean   = sum_rd w_d y_rd/R
    V_d    = c sum_d w_d^2 (y_.d - mean)^2                              of drives: sigma_b^2 S_2 + sigma_e^2 S_2/R
    V_e    = c sum_rd w_d^2 (y_rd - y_r. - y_.d + mean)^2/(R - 1)       sigma_e^2 S_2
    sigma_a^2 = sum_r (y_r. - mean)^2/(R - 1) - V_e                     of tunings; may be negative, and stays so
    V      = V_d + max(sigma_a^2, mean sigma_a^2 of the family)/R

With equal weights of the drives, the estimates above are the analysis of variance of two crossed factors. The variance
between tunings is estimated from only 16 tunings of each method, so the estimate is imprecise. A variance below the
mean variance of the family is therefore replaced by this mean. The interval of a mean is the union of two intervals.
The first interval is Student's interval with the degrees of freedom of Satterthwaite, V^2/(V_d^2/(S_2^2/S_4 - 1) + (V -
V_d)^2/(R - 1)). The second interval is Hall's interval, which removes most of the skewness of the mean
(`intervals.few_intervals`), because the errors of tuned methods are skewed.

Three families of hypotheses are tested. Each family gets a third of the total error probability of 5 %, independently
of the results of the other families. Family H1 compares the average of the adaptations with the plain filters of the
same models. Family H2 compares, in each tuning, the method that is best on the tuning drives with the plain filter that
is best on these drives. The plain filters of H2 were tuned with as many settings as all methods together. Family H3
compares each method with the plain filter of its model, and with the best plain filter.

Source: F. E. Satterthwaite, "An approximate distribution of estimates of variance components", Biometrics Bulletin
2(6), 110-114, 1946, doi:10.2307/3002019.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.evaluation.intervals import SHRUNK, share_interval, untransformed
from jerkbench.evaluation.judgement import LEVEL, Verdict

FAMILIES = 3
SMALL_MARGIN = 0.1
"""Ratios from 1/1.1 to 1.1 count as equal."""


class Losses(NamedTuple):
    """Log errors of an audit: M methods and P plain filters (without adaptation), in R tunings, on D drives.

    Attributes:
        methods: (M, R, D) log errors of each tuned method on the evaluation drives.
        plains: (P, R, D) log errors of each tuned plain filter on the evaluation drives.
        wide: (P, R, D) log errors of each plain filter on the evaluation drives, if it is tuned with as many settings
            as all methods together.
        tuned: (M, R) log errors of each method on the tuning drives.
        tuned_plains: (P, R) log errors of each plain filter on the tuning drives.
        tuned_wide: (P, R) log errors of the plain filters in ``wide`` on the tuning drives.
        model: (M,) index of the plain filter with the same model as each method.
        averaged: (M,) whether hypothesis H1 includes each method in the average of the adaptations.
        picked: (M,) whether hypothesis H2 includes each method in the selection of the best method of a tuning.
    """

    methods: FloatArray
    plains: FloatArray
    wide: FloatArray
    tuned: FloatArray
    tuned_plains: FloatArray
    tuned_wide: FloatArray
    model: IntArray
    averaged: BoolArray
    picked: BoolArray


@dataclass(frozen=True)
class Statement:
    """The statement about the ratio of the errors of methods to the errors of plain filters.

    The methods are better if the ratio is below 1.

    Attributes:
        ratio: geometric mean of the ratio over drives and tunings.
        low: lower end of the interval at the level of the family.
        high: upper end of the interval at the level of the family.
        verdict: verdict that follows from the interval.
        small: whether the interval lies within 1/1.1 to 1.1.
        tuning_sd: standard deviation of the log ratios between tunings. ``tuning_sd`` is 0 if the estimated variance is
            negative.
    """

    ratio: float
    low: float
    high: float
    verdict: Verdict
    small: bool
    tuning_sd: float

    def __str__(self) -> str:
        less = f", by less than {SMALL_MARGIN:.0%}" if self.small and self.verdict is not Verdict.EQUAL else ""
        return f"{self.ratio:.3f} [{self.low:.3f}, {self.high:.3f}] {self.verdict}{less}"


class Statements(NamedTuple):
    """The statements of an audit.

    Attributes:
        average: statement of H1.
        pick: statement of H2.
        same_model_plain: statement of H3 about each method against the plain filter of its model.
        best_plain: statement of H3 about each method against the best plain filter.
    """

    average: Statement
    pick: Statement
    same_model_plain: tuple[Statement, ...]
    best_plain: tuple[Statement, ...]


def log_losses(error_m: FloatArray, failed: BoolArray, level_m: FloatArray, factor: float) -> FloatArray:
    """Return log errors. A failed run counts as ``factor`` times ``level_m``, the error of the untuned plain filter."""
    return np.asarray(np.log(np.where(failed, factor * level_m, error_m)))


def comparisons(losses: Losses) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return the log ratios y for H1 and H2, each (1, R, D), and for H3 against two plain filters, each (M, R, D).

    The first array of H3 contains the log ratios to the plain filter of the same model, and the second array the log
    ratios to the best plain filter.
    """
    against_model = losses.methods - losses.plains[losses.model]
    best, more, pick = picked(losses)
    average = against_model[losses.averaged].mean(axis=0)
    return average[None], (pick - more)[None], against_model, losses.methods - best


def picked(losses: Losses) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the log errors (R, D) of the best of ``plains``, of the best of ``wide``, and of the best method.

    The best filter or method of each tuning is selected by its error on the tuning drives.
    """
    pick = _lowest(losses.methods[losses.picked], losses.tuned[losses.picked])
    return _lowest(losses.plains, losses.tuned_plains), _lowest(losses.wide, losses.tuned_wide), pick


def statements(losses: Losses, weights: FloatArray | None = None) -> Statements:
    """Return the statements of an audit at a joint level of 5 %. ``weights`` (D,) are the weights of the drives."""
    families = comparisons(losses)
    each = [stated(y, level, weights) for y, level in zip(families, _levels(families), strict=True)]
    return Statements(each[0][0], each[1][0], each[2], each[3])


def stated(y: FloatArray, level: float, weights: FloatArray | None = None) -> tuple[Statement, ...]:
    """Return a statement about each of the k sets of log ratios y (k, R, D). Each interval has the level ``level``."""
    mean, low, high, variance = crossed_intervals(y, level, weights)
    said = []
    with np.errstate(over="ignore"):  # exp overflows for very long intervals
        ends = zip(*np.exp([mean, low, high]), np.sqrt(np.maximum(variance, 0.0)), strict=True)
    for ratio, below, above, sd in ends:
        small = bool(below >= 1.0 / (1.0 + SMALL_MARGIN) and above <= 1.0 + SMALL_MARGIN)
        significant = Verdict.BETTER if above < 1.0 else Verdict.WORSE if below > 1.0 else None
        verdict = significant or (Verdict.EQUAL if small else Verdict.UNDECIDED)
        said.append(Statement(float(ratio), float(below), float(above), verdict, small, float(sd)))
    return tuple(said)


def _lowest(judged: FloatArray, tuned: FloatArray) -> FloatArray:
    """Return the log errors (R, D) of the best candidate of each tuning.

    Args:
        judged: (k, R, D) log errors of the candidates on the evaluation drives.
        tuned: (k, R) log errors of the candidates on the tuning drives, which select the best candidate.
    """
    return np.asarray(judged[np.argmin(tuned, axis=0), np.arange(judged.shape[1])])


CrossedInterval = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
"""Mean, lower end and upper end of the mean log ratio, and the variance between tunings, each (k,)."""


def _levels(families: Sequence[FloatArray]) -> list[float]:
    """Return the level of an interval in each group of `comparisons`. The two groups of H3 share its level equally."""
    return [LEVEL / FAMILIES / count for count in (1, 1, 2 * len(families[2]), 2 * len(families[3]))]


def crossed_intervals(y: FloatArray, level: float, weights: FloatArray | None = None) -> CrossedInterval:
    """Return the intervals of the k means of y (k, R, D), each at ``level``.

    A variance between tunings that is below the mean of the k variances is replaced by this mean.
    """
    tunings, drives = y.shape[1:]
    w = np.full(drives, 1.0 / drives) if weights is None else weights / weights.sum()
    of_tuning, of_drive = y @ w, y.mean(axis=1)
    rest = y - of_tuning[:, :, None] - of_drive[:, None, :] + of_tuning.mean(axis=1)[:, None, None]
    squares = np.einsum("krd,krd,d->k", rest, rest, w**2)
    return intervals_from((of_tuning, of_drive, squares), (np.ones(tunings), np.ones(drives), w), level)


def intervals_from(means: Sequence[FloatArray], drawn: Sequence[FloatArray], level: float) -> CrossedInterval:
    """Return the intervals of k means, as `crossed_intervals` does, from the averages of y and its sum of squares.

    Args:
        means: averages (k, R) of y over the drives, averages (k, D) of y over the tunings, and the sums of squares (k,)
            sum_rd w_d^2 (y_rd - y_r. - y_.d + mean)^2.
        drawn: number of times that each tuning (R,) and each drive (D,) is counted, and the weights of the drives (D,).
        level: level of each interval.
    """
    from scipy.special import stdtrit

    (of_tuning, of_drive, squares), (n, m, w), tunings = means, drawn, len(drawn[0])
    S2, S3, S4 = (float((m * w**k).sum()) for k in (2, 3, 4))
    c = S2 / (S2 - 2.0 * S3 + S2**2)
    mean = (n * of_tuning).sum(axis=1) / tunings
    a, b = of_tuning - mean[:, None], of_drive - mean[:, None]
    V_d = c * b**2 @ (m * w**2)
    of_method = (n * a**2).sum(axis=1) / (tunings - 1) - c * squares / (tunings - 1)
    V_a = np.maximum(of_method, of_method.mean()) / tunings
    V = V_d + V_a
    # b * b**2 is much faster than b**3: resampling the audits takes 4 s instead of 19 s.
    third = c * (b * b**2) @ (m * w**3) + (n * a**3).sum(axis=1) / (tunings * (tunings - 1) * (tunings - 2))
    with np.errstate(divide="ignore", invalid="ignore"):  # a variance of 0 gives NaN and the verdict "undecided"
        dof = V**2 / (V_d**2 / (S2**2 / S4 - 1.0) + V_a**2 / (tunings - 1))
        q, error = stdtrit(dof, 1.0 - level / 2.0), np.sqrt(V)
        ends = [mean - untransformed(end, SHRUNK * third / error**3) * error for end in (q, -q)]
    return mean, np.fmin(ends[0], mean - q * error), np.fmax(ends[1], mean + q * error), tunings * V_a


class Error(NamedTuple):
    """The error rate of the complete procedure.

    Attributes:
        audits: number of resampled audits.
        wrong: number of resampled audits with at least one false verdict "better" or "worse".
        low: lower end of the one-sided 95 % interval of the error rate (Clopper and Pearson). ``low`` should be at most
            .05.
    """

    audits: int
    wrong: int
    low: float


def procedure_error(losses: Losses, audits: int) -> Error:
    """Return the error rate of the procedure, estimated by resampling one audit after all true ratios are set to 1.

    The log ratios of each comparison are centred, so that the true ratio of each resampled comparison is 1. Each
    verdict "better" or "worse" in a resampled audit is therefore false. Tunings and drives are drawn with replacement,
    independently of each other. A tuning is drawn together with the method that was selected in this tuning.
    """
    centred = [y - y.mean(axis=(1, 2), keepdims=True) for y in comparisons(losses)]
    levels, edges, wrong = _levels(centred), np.cumsum([len(y) for y in centred])[:-1], 0
    for means, drawn in resampled(np.concatenate(centred), audits, np.random.default_rng(0)):
        families = zip(*(np.split(of, edges) for of in means), strict=True)
        intervals = (
            intervals_from(means_of_family, drawn, level)
            for means_of_family, level in zip(families, levels, strict=True)
        )
        wrong += any((low > 0).any() or (high < 0).any() for _, low, high, _ in intervals)
    return Error(audits, wrong, share_interval(wrong, audits, 1 - 2 * LEVEL)[0])


AUDITS_AT_ONCE = 16
"""Number of audits that are resampled in one step, so that y, which does not fit into the cache, is read less often."""


def resampled(y: FloatArray, audits: int, random: np.random.Generator) -> Iterator[tuple[Sequence[FloatArray], ...]]:
    """Yield the inputs ``means`` and ``drawn`` of `intervals_from` for resampled tunings and drives of y (k, R, D).

    Tuning r is drawn n_r times, and drive d is drawn m_d times. Let y_.d, y_r. and mean be the means over the resampled
    tunings, over the resampled drives, and over both. Let u_rd = y_rd - y_.d and v_r = y_r. - mean. The sums over r of
    n_r u_rd and of n_r v_r are zero, so that::

        sum_rd n_r m_d (u_rd - v_r)^2 = sum_rd n_r m_d y_rd^2 - R sum_d m_d y_.d^2 - D sum_r n_r v_r^2
    """
    tunings, drives = sizes = y.shape[1:]
    yy, w = y * y, np.full(drives, 1.0 / drives)
    for begin in range(0, audits, AUDITS_AT_ONCE):
        several = range(min(AUDITS_AT_ONCE, audits - begin))
        drawn = [[np.bincount(random.integers(k, size=k), minlength=k) for k in sizes] for _ in several]
        n, m = (np.array(counts, dtype=np.float64) for counts in zip(*drawn, strict=True))
        of_tuning, of_square, of_drive = y @ m.T / drives, yy @ m.T / drives, n @ y / tunings
        for j in several:
            a, b = of_tuning[:, :, j], of_drive[:, j]
            v = a - (a @ n[j] / tunings)[:, None]
            squares = (of_square[:, :, j] - v * v) @ n[j] - tunings * (b * b @ m[j]) / drives
            yield (a, b, squares / drives), (n[j], m[j], w)


# The comparison of methods over several scenarios.

_RESAMPLES = 1999
_SEED = 14


class RankRange(NamedTuple):
    """The ranks of k methods with their ranges. The best method has rank 1.

    Attributes:
        rank: (k,) rank by the mean log error over scenarios and seeds.
        low: (k,) best rank in the bootstrap range.
        high: (k,) worst rank in the bootstrap range.
    """

    rank: IntArray
    low: IntArray
    high: IntArray


def rank_range(log_costs: FloatArray) -> RankRange:
    """Return the ranks of k methods with a 95 % bootstrap range.

    Scenarios and seeds are drawn with replacement. The ranges of the ranks are therefore valid for other scenarios of
    this kind and for other seeds. The log error of a failed run is infinite, so a method with a failed run is ranked
    behind all methods without failed runs.

    Args:
        log_costs: (S, n, k) log errors in S scenarios, on n seeds, of k methods.
    """
    s, n, k = log_costs.shape
    rng = np.random.default_rng(_SEED)
    places = np.empty((_RESAMPLES, k), dtype=np.int64)
    for row in range(_RESAMPLES):
        drawn = log_costs[rng.integers(0, s, s)][:, rng.integers(0, n, n)]
        places[row] = _places(drawn.mean(axis=(0, 1)))
    ends = np.quantile(places, [0.025, 0.975], axis=0, method="closest_observation")
    return RankRange(_places(log_costs.mean(axis=(0, 1))), *ends.astype(np.int64))


def _places(costs: FloatArray) -> IntArray:
    """Return the rank (k,) of each method. Methods with equal costs share the better rank."""
    return np.asarray(np.sum(costs[None, :] < costs[:, None], axis=1) + 1, dtype=np.int64)


class OverScenarios(NamedTuple):
    """The comparison of the errors a and b of two methods over S scenarios, with the same n seeds in each scenario.

    Attributes:
        ratio: geometric mean of a/b over scenarios and seeds.
        low: lower end of the interval, which is valid for other scenarios and seeds. ``low`` is NaN for a single
            scenario.
        high: upper end of the interval, NaN for a single scenario.
        dof: degrees of freedom of the interval (Satterthwaite).
        worst: index of the scenario with the largest ratio.
        worst_ratio: geometric mean of a/b over the seeds of the scenario ``worst``.
    """

    ratio: float
    low: float
    high: float
    dof: float
    worst: int
    worst_ratio: float


def over_scenarios(d: FloatArray, confidence: float = 0.95) -> OverScenarios:
    """Return the comparison of two methods by a mixed model of their log ratios log(a/b) (S, n), all finite.

    ::

        d_si = mu + u_s + v_i + e_si        u_s ~ N(0, sigma_u^2), v_i ~ N(0, sigma_v^2), e_si ~ N(0, sigma_e^2)

    The equation is the model log error ~ method + (method | scenario) + (method | seed) for two methods. Effects of a
    scenario or a seed that are common to both methods cancel in d. The estimates use the mean squares MSS of scenarios,
    MSI of seeds, and MSE of residuals::

        sigma_e^2 = MSE,  sigma_u^2 = (MSS - MSE)/n,  sigma_v^2 = (MSI - MSE)/S,  var(mu) = (MSS + MSI - MSE)/(S n)

    A negative variance is replaced by 0, and its mean square is pooled with the residuals. Because the data are
    balanced, the result is the restricted maximum likelihood estimate.

    Source: Searle, Casella and McCulloch, "Variance Components", Wiley (1992), 4.5; Satterthwaite, "An approximate
    distribution of estimates of variance components", Biometrics Bulletin 2 (1946).
    """
    from scipy.special import stdtrit

    (s, n), means, total = d.shape, d.mean(axis=1), d.mean()
    worst, mu = int(np.argmax(means)), float(means.mean())
    scenario, seed = n * float(np.sum((means - total) ** 2)), s * float(np.sum((d.mean(axis=0) - total) ** 2))
    rest, freedom = max(0.0, float(np.sum((d - total) ** 2)) - scenario - seed), (s - 1.0) * (n - 1.0)
    factors = [(scenario, s - 1.0), (seed, n - 1.0)]  # sum of squares and degrees of freedom
    for factor in sorted(factors, key=lambda factor: factor[0] / max(1.0, factor[1])):
        square, freedom_of_factor = factor
        if freedom > 0 and square * freedom <= rest * freedom_of_factor:  # the variance of this factor is not positive
            rest, freedom = rest + square, freedom + freedom_of_factor
            factors.remove(factor)
    each = rest / max(1.0, freedom)
    retained = [(square / of_factor, of_factor) for square, of_factor in factors if of_factor > 0]
    # A pooled mean square equals MSE, so it cancels in MSS + MSI - MSE.
    terms = [*retained, (-each, freedom)] if len(retained) == 2 else retained or [(each, freedom)]
    variance = sum(square for square, _ in terms)
    spread = sum(square**2 / freedom_of_factor for square, freedom_of_factor in terms if freedom_of_factor > 0)
    error, dof = float(np.sqrt(variance / (s * n))), variance**2 / spread if spread > 0 else np.inf
    half = float(stdtrit(dof, (1 + confidence) / 2)) * error if s > 1 else np.nan
    ratio, low, high, worst_ratio = np.exp([mu, mu - half, mu + half, means[worst]]).tolist()
    return OverScenarios(ratio, low, high, dof, worst, worst_ratio)
