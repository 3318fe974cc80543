"""Exact tests and intervals against scipy, statsmodels and simulation."""

import math

import numpy as np
import pytest
from scipy.stats import binomtest

from jerkbench.evaluation.statistics.exact_tests import equal_median_p, sign_p
from jerkbench.evaluation.statistics.intervals.median import median_intervals, quantiles
from jerkbench.evaluation.statistics.intervals.share import share_interval


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
    found = quantiles(np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, np.inf, np.inf, np.nan]))
    assert (found.median, found.quartiles, found.lost, found.n) == (5.0, (3.0, 7.0), 2, 9)
    assert found.high == math.inf
    assert quantiles(np.array([1.0, np.inf, np.inf])).median == math.inf
    assert quantiles(np.array([])).n == 0


@pytest.mark.parametrize("shift", [0.0, 0.02, 0.05])
def test_equality_of_the_median_is_two_one_sided_sign_tests(shift):
    d = shift + 0.02 * np.random.default_rng(1).standard_normal(25)
    expected = max(
        binomtest(int((d >= 0.03).sum()), 25, alternative="less").pvalue,
        binomtest(int((d <= -0.03).sum()), 25, alternative="less").pvalue,
    )
    assert equal_median_p(d, 0.03) == pytest.approx(expected)
