"""Statements over random drives and independent tunings: methods against plain filters that were tuned alike.

Every method m was tuned R times, and each result judged on the same D drives. y_rd is the difference of its log error
and a plain filter's; both the tunings a_r and the drives b_d are random, and crossed::

    y_rd = mu + a_r + b_d + e_rd,    ratio = exp(mu)

A drive has the weight w_d, the sum of which is 1. With S_k = sum w^k and c = S_2/(S_2 - 2 S_3 + S_2^2)::

    mean   = sum_rd w_d y_rd/R
    V_d    = c sum_d w_d^2 (y_.d - mean)^2                              of drives: sigma_b^2 S_2 + sigma_e^2 S_2/R
    V_e    = c sum_rd w_d^2 (y_rd - y_r. - y_.d + mean)^2/(R - 1)       sigma_e^2 S_2
    sigma_a^2 = sum_r (y_r. - mean)^2/(R - 1) - V_e                     of tunings; may be negative, and stays so
    V      = V_d + max(own sigma_a^2, mean sigma_a^2 of the family)/R

Without weights it is the analysis of variance of two crossed factors. The search of a method may have been lucky or
not 16 times, which says little of how much luck there is: hence the family's mean. The interval is Student's, with the
degrees of freedom of Satterthwaite, V^2/(V_d^2/(S_2^2/S_4 - 1) + (V - V_d)^2/(R - 1)), and the shortest that holds it
and Hall's, which removes most of the skewness of the mean (`intervals.few_intervals`): the luck of a search is skewed.

Three families of hypotheses share an error of 5 % alike, without a gate: H1, the average adaptation against the plain
filters of its models; H2, in each tuning whoever has the lowest error on the tuning drives, against the plain filter
that has, with as many settings tried; H3, every method against the plain filter of its model and against the best one.

Source: F. E. Satterthwaite, "An approximate distribution of estimates of variance components", Biometrics Bulletin
2(6), 110-114, 1946, doi:10.2307/3002019.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import PluginError
from jerkbench.evaluation.intervals import SHRUNK, share_interval, untransformed
from jerkbench.evaluation.judgement import LEVEL, Verdict

FAMILIES = 3
SMALL_MARGIN = 0.1
"""Ratios from 1/1.1 to 1.1 are equal."""
AUDITS = 2000


class Losses(NamedTuple):
    """Log errors of an audit: M methods and P plain filters, in R tunings, on D drives.

    Attributes:
        methods: (M, R, D) of each method, as tuned, on the drives to judge on.
        plains: (P, R, D) of each plain filter, likewise.
        wide: (P, R, D) of the plain filters with as many settings tried as all methods together.
        tuned: (M, R) of each method on the drives to tune on.
        tuned_plains: (P, R) likewise.
        tuned_wide: (P, R) likewise.
        model: (M,) which plain filter has the model of each method.
        averaged: (M,) which methods are the average adaptation of H1.
        picked: (M,) among which methods H2 picks.
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
    """What is said of one ratio; below 1 is better.

    Attributes:
        ratio: geometric mean over drives and tunings.
        low: lower end of its interval, at the level of its family.
        high: upper end.
        verdict: by the interval.
        small: whether all of the interval is within 10 % of 1: better or worse, but by less than 10 %.
        tuning_sd: standard deviation between tunings that was counted, of log ratios; negative variances count as 0.
    """

    ratio: float
    low: float
    high: float
    verdict: Verdict
    small: bool
    tuning_sd: float

    def __str__(self) -> str:
        """Say ratio, interval and verdict."""
        less = f", by less than {SMALL_MARGIN:.0%}" if self.small and self.verdict is not Verdict.EQUAL else ""
        return f"{self.ratio:.3f} [{self.low:.3f}, {self.high:.3f}] {self.verdict}{less}"


class Statements(NamedTuple):
    """The statements of an audit; those of H3 in the order of the methods."""

    average: Statement
    pick: Statement
    own_plain: tuple[Statement, ...]
    best_plain: tuple[Statement, ...]


def log_losses(error_m: FloatArray, lost: BoolArray, level_m: FloatArray, factor: float = 100.0) -> FloatArray:
    """Return log errors; a lost run costs ``factor`` times what baseline + none has there at its defaults."""
    return np.asarray(np.log(np.where(lost, factor * level_m, error_m)))


def mixture_weights(member: BoolArray, share: float) -> FloatArray:
    """Return weights of drives (D,), as if ``share`` of all were those that are ``member``: of another mixture.

    Raises:
        PluginError: the share is none, or there are no such drives: what was never drawn cannot be added.
    """
    count = np.array([member.sum(), (~member).sum()])
    shares = np.array([share, 1.0 - share])
    if not 0.0 <= share <= 1.0 or (shares[count == 0] > 0).any():
        raise PluginError(
            f"{count[0]} of {count.sum()} drives are of that kind, so its share cannot be {share:g}; give one from 0 to"
            " 1, of what was drawn."
        )
    each = shares / np.maximum(count, 1)
    return np.asarray(np.where(member, each[0], each[1]))


def comparisons(losses: Losses) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return y of H1 (1, R, D), H2 (1, R, D), and of H3 (M, R, D) against the own and against the best plain filter."""
    own = losses.methods - losses.plains[losses.model]
    best, more, pick = picked(losses)
    average = own[losses.averaged].mean(axis=0)
    return average[None], (pick - more)[None], own, losses.methods - best


def picked(losses: Losses) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return (R, D) of the best plain filter of each tuning, of that with more settings tried, of the best method."""
    pick = _lowest(losses.methods[losses.picked], losses.tuned[losses.picked])
    return _lowest(losses.plains, losses.tuned_plains), _lowest(losses.wide, losses.tuned_wide), pick


def statements(losses: Losses, weights: FloatArray | None = None) -> Statements:
    """Return what an audit says, at an error of 5 % for all of it together; ``weights`` (D,): of another mixture."""
    families = comparisons(losses)
    each = [stated(y, level, weights) for y, level in zip(families, _levels(families), strict=True)]
    return Statements(each[0][0], each[1][0], each[2], each[3])


def stated(y: FloatArray, level: float, weights: FloatArray | None = None) -> tuple[Statement, ...]:
    """Return a statement on each of the log ratios y (k, R, D), each at ``level``."""
    mean, low, high, variance = crossed_intervals(y, level, weights)
    said = []
    with np.errstate(over="ignore"):  # an interval without information is infinite
        ends = zip(*np.exp([mean, low, high]), np.sqrt(np.maximum(variance, 0.0)), strict=True)
    for ratio, below, above, sd in ends:
        small = bool(below >= 1.0 / (1.0 + SMALL_MARGIN) and above <= 1.0 + SMALL_MARGIN)
        significant = Verdict.BETTER if above < 1.0 else Verdict.WORSE if below > 1.0 else None
        verdict = significant or (Verdict.EQUAL if small else Verdict.UNDECIDED)
        said.append(Statement(float(ratio), float(below), float(above), verdict, small, float(sd)))
    return tuple(said)


def _lowest(judged: FloatArray, tuned: FloatArray) -> FloatArray:
    """Return (R, D): in each tuning those of the one with the lowest error on its tuning drives (k, R)."""
    return np.asarray(judged[np.argmin(tuned, axis=0), np.arange(judged.shape[1])])


CrossedInterval = tuple[FloatArray, FloatArray, FloatArray, FloatArray]
"""Mean, lower and upper end of the logarithms, and the variance of the tunings, each (k,)."""


def _levels(families: Sequence[FloatArray]) -> list[float]:
    """The level of each interval of the four; H3 is two of them, whose statements share its level."""
    return [LEVEL / FAMILIES / count for count in (1, 1, 2 * len(families[2]), 2 * len(families[3]))]


def crossed_intervals(y: FloatArray, level: float, weights: FloatArray | None = None) -> CrossedInterval:
    """Return the intervals of the means of y (k, R, D), each at ``level``; their tunings' variances are pooled."""
    tunings, drives = y.shape[1:]
    w = np.full(drives, 1.0 / drives) if weights is None else weights / weights.sum()
    of_tuning, of_drive = y @ w, y.mean(axis=1)
    rest = y - of_tuning[:, :, None] - of_drive[:, None, :] + of_tuning.mean(axis=1)[:, None, None]
    squares = np.einsum("krd,krd,d->k", rest, rest, w**2)
    return intervals_from((of_tuning, of_drive, squares), (np.ones(tunings), np.ones(drives), w), level)


def intervals_from(means: Sequence[FloatArray], drawn: Sequence[FloatArray], level: float) -> CrossedInterval:
    """Return the intervals of k means, as `crossed_intervals` does.

    Args:
        means: y_r. (k, R), y_.d (k, D), and (k,) sum_rd w_d^2 (y_rd - y_r. - y_.d + mean)^2.
        drawn: how often each tuning is there (R,) and each drive (D,), and the weight of a drive each time (D,).
        level: of each.
    """
    from scipy.special import stdtrit

    (of_tuning, of_drive, squares), (n, m, w), tunings = means, drawn, len(drawn[0])
    S2, S3, S4 = (float((m * w**k).sum()) for k in (2, 3, 4))
    c = S2 / (S2 - 2.0 * S3 + S2**2)
    mean = (n * of_tuning).sum(axis=1) / tunings
    a, b = of_tuning - mean[:, None], of_drive - mean[:, None]
    V_d = c * b**2 @ (m * w**2)
    own = (n * a**2).sum(axis=1) / (tunings - 1) - c * squares / (tunings - 1)
    V_a = np.maximum(own, own.mean()) / tunings
    V = V_d + V_a
    # b * b**2: as b**3, a general power, the drawn audits took 19 s instead of 4.
    third = c * (b * b**2) @ (m * w**3) + (n * a**3).sum(axis=1) / (tunings * (tunings - 1) * (tunings - 2))
    with np.errstate(divide="ignore", invalid="ignore"):  # without any variance the ends are NaN: undecided
        dof = V**2 / (V_d**2 / (S2**2 / S4 - 1.0) + V_a**2 / (tunings - 1))
        q, error = stdtrit(dof, 1.0 - level / 2.0), np.sqrt(V)
        ends = [mean - untransformed(end, SHRUNK * third / error**3) * error for end in (q, -q)]
    return mean, np.fmin(ends[0], mean - q * error), np.fmax(ends[1], mean + q * error), tunings * V_a


class Error(NamedTuple):
    """How often the whole procedure makes an error.

    Attributes:
        audits: number of resampled audits.
        wrong: number of audits with a false "better" or "worse".
        low: lower end of the one-sided 95 % interval of their fraction (Clopper and Pearson); it should be at most .05.
    """

    audits: int
    wrong: int
    low: float


def procedure_error(losses: Losses, audits: int = AUDITS, seed: int = 0) -> Error:
    """Return the error rate of audits that are resampled from one audit, with ratios of 1.

    Each comparison is centred, so that its ratio is 1. Tunings and drives are drawn with replacement, independently of
    each other; a tuning is drawn together with the method that it picks. Each statement "better" or "worse" is false.
    """
    centred = [y - y.mean(axis=(1, 2), keepdims=True) for y in comparisons(losses)]
    levels, edges, wrong = _levels(centred), np.cumsum([len(y) for y in centred])[:-1], 0
    for means, drawn in resampled(np.concatenate(centred), audits, np.random.default_rng(seed)):
        families = zip(*(np.split(of, edges) for of in means), strict=True)
        intervals = (intervals_from(own, drawn, level) for own, level in zip(families, levels, strict=True))
        wrong += any((low > 0).any() or (high < 0).any() for _, low, high, _ in intervals)
    return Error(audits, wrong, share_interval(wrong, audits, 1 - 2 * LEVEL)[0])


AUDITS_AT_ONCE = 16
"""So many audits are drawn at once: each goes over all of y, which does not fit into the processor's cache."""


def resampled(y: FloatArray, audits: int, random: np.random.Generator) -> Iterator[tuple[Sequence[FloatArray], ...]]:
    """Yield what `intervals_from` needs of ``audits`` of tunings and drives that are drawn from y (k, R, D); no copies.

    With n_r and m_d, how often each is drawn, u_rd = y_rd - y_.d and v_r = y_r. - mean, sums over r of n_r u_rd and of
    n_r v_r are zero, and::

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
