"""The interval of a mean of few, skewed values: against the cubic's root, and by how often it holds the truth."""

import numpy as np
import pytest
from scipy.stats import ttest_1samp

from jerkbench.evaluation.intervals import SHRUNK, few_intervals, hall_intervals, student_intervals
from roots import hall_ends, mean_ends


def skewed(rng, shape):
    """Of mean 0 and skewness 1.75."""
    return np.exp(0.5 * rng.standard_normal(shape)) - np.exp(0.125)


@pytest.mark.parametrize("n", [3, 5, 19])
@pytest.mark.parametrize("share", [1.0, SHRUNK])
def test_hall_s_ends_are_the_roots_of_his_cubic(n, share):
    values = skewed(np.random.default_rng(n), (20, n))
    assert np.transpose(hall_intervals(values, 0.95, share)) == pytest.approx(
        np.array([hall_ends(row, share) for row in values]), rel=1e-6, abs=1e-9
    )


@pytest.mark.parametrize("n", [3, 5, 19])
def test_of_few_values_it_holds_both(n):
    values = skewed(np.random.default_rng(n), (20, n))
    for row, low, high in zip(values, *few_intervals(values, 0.95), strict=True):
        assert (low, high) == pytest.approx(mean_ends(row), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("n", [2, 3, 12])
def test_student_s_interval_is_that_of_the_t_test(n):
    d = np.random.default_rng(n).normal(size=(4, n))
    ends = ttest_1samp(d, 0, axis=1).confidence_interval(0.9)
    assert np.allclose(student_intervals(d, 0.9), (ends.low, ends.high), rtol=1e-12)


@pytest.mark.parametrize("n", [2, 20, 50])
def test_of_two_and_of_many_it_is_student_s(n):
    values = skewed(np.random.default_rng(n), (20, n))
    assert np.array_equal(few_intervals(values, 0.95), student_intervals(values, 0.95))


def test_without_skewness_and_without_scatter_it_is_student_s():
    values = np.array([[-2.0, -1.0, 0.0, 1.0, 2.0], [3.0] * 5])
    assert np.transpose(few_intervals(values, 0.95)) == pytest.approx(np.transpose(student_intervals(values, 0.95)))
    assert np.isnan(few_intervals(np.zeros((1, 1)), 0.95)).all()


@pytest.mark.parametrize("n", [5, 6, 10])
@pytest.mark.parametrize("sign", [1, -1])
def test_it_covers_skewed_means_where_student_s_does_not(n, sign):
    values = sign * skewed(np.random.default_rng(n), (20_000, n))
    assert 0.93 < covered(few_intervals(values, 0.95)) < 0.97
    assert covered(student_intervals(values, 0.95)) < 0.93


@pytest.mark.parametrize("n", [5, 6, 10])
def test_it_covers_normal_means(n):
    assert 0.93 < covered(few_intervals(np.random.default_rng(n).standard_normal((20_000, n)), 0.95)) < 0.97


def covered(ends):
    low, high = ends
    return np.mean((low <= 0) & (high >= 0))
