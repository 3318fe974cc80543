"""Exact tests and intervals against scipy, statsmodels and simulation."""

import math

import numpy as np
import pytest
from scipy.stats import beta, binomtest

from jerkbench.evaluation.intervals import (
    failure_bound,
    failures_text,
    median_intervals,
    quantiles_of_rows,
    seeds_without_failure,
    share_interval,
)
from jerkbench.evaluation.judgement import median_p, sign_p
from jerkbench.evaluation.over_seeds import Samples, centres


@pytest.mark.parametrize(("count", "n"), [(0, 5), (1, 20), (12, 20), (20, 20)])
def test_the_share_has_clopper_and_pearsons_interval(count, n):
    expected = binomtest(count, n).proportion_ci(0.95, method="exact")
    assert share_interval(count, n) == pytest.approx((expected.low, expected.high))


@pytest.mark.parametrize(("a", "b"), [(0, 0), (1, 0), (5, 5), (12, 0), (3, 11)])
def test_the_sign_test_is_mcnemars_exact_one(a, b):
    contingency = pytest.importorskip("statsmodels.stats.contingency_tables")
    expected = contingency.mcnemar([[3, a], [b, 4]], exact=True).pvalue if a + b else 1.0
    assert sign_p(a, b) == pytest.approx(expected)


def test_the_median_has_an_interval_from_five_values_on():
    assert np.isnan(median_intervals(np.arange(4.0)[None], 0.95)).all()
    assert median_intervals(np.arange(5.0)[None], 0.95) == (0.0, 4.0)


@pytest.mark.parametrize("n", [6, 7, 11, 20, 51])
def test_the_interval_covers_the_median(n):
    rng = np.random.default_rng(n)
    low, high = median_intervals(np.sort(rng.standard_normal((4000, n)), axis=1), 0.95)
    assert 0.94 <= np.mean((low <= 0) & (high >= 0)) <= 0.965


def test_the_interval_lies_between_the_two_of_scipy():
    """Of 11 values the 2nd to the 10th cover 98.8 %, the 3rd to the 9th 93.5 %."""
    values = np.arange(1.0, 12.0)
    ((low,), (high,)) = median_intervals(values[None], 0.95)
    assert 2 < low < 3
    assert 9 < high < 10
    assert low + high == pytest.approx(12)


def test_lost_runs_stand_at_the_top():
    (found,) = centres(Samples.of([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, np.inf, np.inf, np.nan]]))
    assert (found.value, found.lower_quartile, found.upper_quartile, found.high) == (5.0, 3.0, 7.0, math.inf)
    assert quantiles_of_rows(np.array([[1.0, np.inf, np.inf]]))[0] == math.inf
    assert np.isnan(quantiles_of_rows(np.empty((1, 0)))).all()


@pytest.mark.parametrize(("count", "n"), [(0, 1), (0, 20), (3, 20), (19, 20), (20, 20)])
def test_the_bound_of_losses_is_the_one_sided_quantile_of_beta(count, n):
    assert failure_bound(count, n) == pytest.approx(beta.ppf(0.95, count + 1, n - count) if count < n else 1.0)


def test_losses_that_twenty_seeds_did_not_show_are_bounded_in_words():
    assert failures_text(0, 0, 20) == "0 of 20 failed (up to 14 %)"
    assert failures_text(3, 0, 20) == "3 of 20 failed (up to 34 %)"
    assert failures_text(0, 0, 100) == "0 of 100 failed (up to 3.0 %)"
    assert failures_text(5, 0, 5) == "5 of 5 failed (up to 100 %)"


def test_three_percent_of_losses_are_excluded_by_99_seeds_without_one():
    assert seeds_without_failure(0.03) == 99
    assert failure_bound(0, 99) < 0.03 < failure_bound(0, 98)
    assert (seeds_without_failure(0.0), seeds_without_failure(1.0)) == (math.inf, 1)


@pytest.mark.parametrize("confidence", [0.95, 0.975, 0.999, 1 - 1e-5])
@pytest.mark.parametrize("n", [6, 11, 20, 51])
def test_the_interval_of_a_median_inverts_the_sign_test(n, confidence):
    """0 lies outside exactly where the p of the sign test, ties for either side, is at most what is left."""
    rng = np.random.default_rng(n)
    for shift in np.linspace(0.0, 3.0, 40):
        d = np.round(rng.standard_normal(n) + shift, 1)
        ((low,), (high,)) = median_intervals(np.sort(d)[None], confidence, exact=True)
        outside = bool(low > 0 or high < 0)
        assert outside is (median_p(d) <= 1 - confidence)


@pytest.mark.parametrize("shift", [0.0, 0.3, 1.0])
def test_the_p_of_a_median_is_the_binomial_one(shift):
    d = shift + np.random.default_rng(1).standard_normal(25)
    assert median_p(d) == pytest.approx(binomtest(int((d > 0).sum()), 25).pvalue)
