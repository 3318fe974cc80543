"""Verdicts: what they say of cases whose truth is known, and how seldom they are wrong."""

import math

import numpy as np
import pytest
from scipy.stats import binomtest, false_discovery_control, ttest_1samp

from jerkbench.evaluation.statistics.family import Correction
from jerkbench.evaluation.statistics.judgement import Verdict, judged
from jerkbench.evaluation.statistics.log_ratio import log_ratios
from jerkbench.evaluation.statistics.max_t import MaxT, max_t


def scatter(rng, sigma, n=20):
    return np.exp(sigma * rng.standard_normal(n))


def judge(a, b, **options):
    (found,) = judged([log_ratios(a, b)], **options)
    return found


@pytest.fixture
def rng():
    return np.random.default_rng(14)


def test_better_equal_worse_and_undecided(rng):
    base = scatter(rng, 0.5)
    cases = [0.9 * scatter(rng, 0.05), 1.005 * scatter(rng, 0.02), 1.2 * scatter(rng, 0.05), scatter(rng, 0.3)]
    found = judged([log_ratios(base * case, base) for case in cases])
    assert [one.verdict for one in found] == [Verdict.BETTER, Verdict.EQUAL, Verdict.WORSE, Verdict.UNDECIDED]
    assert judged([log_ratios(base, base * case) for case in cases])[0].verdict is Verdict.WORSE


def test_ratio_and_interval_are_students_of_the_logarithms(rng):
    a, b = scatter(rng, 0.2, 9), scatter(rng, 0.2, 9)
    ends = ttest_1samp(np.log(a / b), 0).confidence_interval(0.95)
    found = judge(a, b)
    assert (found.ratio, found.low, found.high) == pytest.approx(
        (math.exp(np.log(a / b).mean()), math.exp(ends.low), math.exp(ends.high))
    )


def test_twelve_lost_of_twenty_runs_are_never_better(rng):
    base = scatter(rng, 0.3)
    risky = 0.9 * base * scatter(rng, 0.01)
    risky[:12] = np.inf
    found = judge(risky, base)
    assert found.verdict is Verdict.MORE_LOST
    assert found.ratio == math.inf  # the median run is lost
    assert found.p_lost == pytest.approx(2 * binomtest(12, 12).pvalue)  # one of two tests
    assert judge(base, risky).verdict is Verdict.FEWER_LOST


@pytest.mark.parametrize("lost", range(1, 12))
def test_who_loses_more_runs_is_not_better(rng, lost):
    base = scatter(rng, 0.3)
    risky = 0.5 * base * scatter(rng, 0.01)
    risky[:lost] = np.inf
    assert judge(risky, base).verdict in {Verdict.UNDECIDED, Verdict.MORE_LOST}


def test_a_lost_run_is_the_worst_rank(rng):
    """One run of b is lost, and a is smaller in all others: the sign test has twenty of twenty for a."""
    base = scatter(rng, 0.3)
    a = 0.9 * base * scatter(rng, 0.01)
    b = base.copy()
    b[4] = np.inf
    found = judge(a, b)
    assert found.verdict is Verdict.BETTER
    assert found.p == pytest.approx(2 * binomtest(20, 20).pvalue)


def test_runs_lost_by_both_leave_the_others_equal(rng):
    base = scatter(rng, 0.3)
    base[:3] = np.inf
    with np.errstate(invalid="ignore"):
        found = judge(base * scatter(rng, 0.002), base)
    assert found.verdict is Verdict.EQUAL
    assert found.failures == (3, 3)


def test_a_lock_out_is_no_scatter(rng):
    """Of one run that is fifty times as wrong the mean says nothing; the median does, by the exact sign test."""
    base = scatter(rng, 0.3)
    a = 0.8 * base * scatter(rng, 0.01)
    b = base.copy()
    b[0] *= 50
    found = judge(a, b)
    assert found.median
    assert found.failures == (0, 1)
    assert found.verdict is Verdict.BETTER
    assert found.ratio == pytest.approx(0.8, rel=0.02)


def test_bit_for_bit_the_same_is_equal(rng):
    base = scatter(rng, 0.3)
    assert judge(base, base.copy()).verdict is Verdict.EQUAL
    assert judge(base[:2], base[:2].copy()).verdict is Verdict.UNDECIDED


def test_too_few_seeds_show_nothing(rng):
    base = scatter(rng, 0.3, 3)
    assert judge(base / 25 * scatter(rng, 0.01, 3), base).verdict is Verdict.UNDECIDED


def test_without_a_seed_there_is_no_verdict():
    found = judge([np.nan], [1.0])
    assert (found.n, found.verdict) == (0, Verdict.UNDECIDED)
    assert math.isnan(found.ratio)


def test_the_margin_decides_what_is_equal(rng):
    base = scatter(rng, 0.3)
    a = 1.05 * base * scatter(rng, 0.01)
    assert judge(a, base).verdict is Verdict.WORSE
    assert judge(a, base, margin=0.1).verdict is Verdict.EQUAL


def test_p_grows_with_the_study(rng):
    one = log_ratios(scatter(rng, 0.1) * 0.93, scatter(rng, 0.1))
    others = [log_ratios(scatter(rng, 0.1), scatter(rng, 0.1)) for _ in range(60)]
    assert judged([one, *others])[0].p > judged([one])[0].p


def test_false_discovery_is_benjamini_and_hochberg_of_students_p(rng):
    d = 0.1 * rng.standard_normal((8, 12)) + 0.05
    found = judged([log_ratios(np.exp(row), np.ones(12)) for row in d], correction=Correction.FDR)
    expected = false_discovery_control([ttest_1samp(row, 0).pvalue for row in d])
    np.testing.assert_allclose([one.p for one in found], expected)


def test_the_largest_t_of_one_comparison_is_the_studentised_bootstraps(rng):
    """Against scipy's own resamples of the studentised mean: the 95 % points agree to the scatter of 5000 draws."""
    x = rng.standard_normal(15)
    drawn = rng.choice(x - x.mean(), (5000, 15))
    t = np.abs(ttest_1samp(drawn, 0, axis=1).statistic)
    assert max_t(x[None]).critical(0.05) == pytest.approx(np.quantile(t, 0.95), rel=0.06)


def test_p_and_critical_value_agree():
    family = MaxT(np.sort(np.random.default_rng(3).exponential(size=1999)))
    c = family.critical(0.05)
    below, above = family.p(np.array([c * (1 - 1e-9), c]))
    assert above <= 0.05 < below
    assert family.p(np.array([1e9]))[0] == pytest.approx(1 / 2000)
    assert math.isinf(MaxT(family.maxima, share=1e-3).critical(0.05)) is True


@pytest.mark.parametrize("name", ["skewed", "t3", "normal"])
def test_few_studies_of_equal_methods_have_a_false_sentence(name):
    """400 studies of 10 comparisons over 20 seeds: 5 % have a standard error of 1.1 %."""
    rng = np.random.default_rng(15)
    draws = {
        "skewed": lambda: np.exp(0.5 * rng.standard_normal((10, 20))) - math.exp(0.125),
        "t3": lambda: rng.standard_t(3, (10, 20)),
        "normal": lambda: rng.standard_normal((10, 20)),
    }
    wrong = 0
    for _ in range(400):
        found = judged([log_ratios(np.exp(0.1 * row), np.ones(20)) for row in draws[name]()])
        wrong += any(one.verdict in {Verdict.BETTER, Verdict.WORSE} for one in found)
    assert wrong / 400 <= 0.072
