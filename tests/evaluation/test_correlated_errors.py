"""The interval from one recording against closed forms of an autoregressive series."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import t
from signed_intervals import mean_interval

from jerkbench.evaluation.correlated_errors import autocorrelation, block_interval, correlation_rows


def autoregressive(phi, n, seed, count=1):
    """Return (count, n) stationary x_k = phi x_{k-1} + w_k, of variance 1."""
    noise = np.random.default_rng(seed).normal(size=(count, n + 500)) * math.sqrt(1 - phi**2)
    return lfilter([1.0], [1.0, -phi], noise, axis=1)[:, 500:]


@pytest.mark.parametrize("phi", [0.0, 0.5, 0.9])
def test_the_correlation_time_is_that_of_the_process(phi):
    expected = (1 + phi) / (1 - phi)
    found = np.mean([correlation_rows(x) for x in autoregressive(phi, 5000, 1, count=40)])
    assert found == pytest.approx(expected, rel=0.12)


def test_the_autocorrelation_is_the_naive_sum_and_of_columns_that_of_each():
    x = autoregressive(0.7, 50, 2)[0]
    c = x - x.mean()
    naive = [sum(c[i] * c[i + k] for i in range(50 - k)) / sum(c * c) for k in range(50)]
    np.testing.assert_allclose(autocorrelation(x), naive, atol=1e-12)
    np.testing.assert_allclose(autocorrelation(x, 20), naive[:21], atol=1e-12)
    np.testing.assert_allclose(autocorrelation(x[:9]), autocorrelation(x[:9], 8), atol=1e-12)
    columns = np.column_stack([*autoregressive(0.5, 70, 3, count=2), np.full(70, 0.1)])
    for last in (None, 20):
        together = autocorrelation(columns, last)
        for k, column in enumerate(columns.T):
            np.testing.assert_allclose(together[:, k], autocorrelation(column, last), atol=1e-12)
    np.testing.assert_array_equal(together[:, 2], [1.0] + [0.0] * 20)


def test_blocks_are_wider_than_independent_rows_where_errors_follow_each_other():
    wider = []
    for squares in autoregressive(0.95, 4000, 3, count=20) ** 2:
        got = block_interval(squares)
        blocks = len(squares) / got.block
        student = t.ppf(0.975, blocks - 1) * math.sqrt(blocks / (blocks - 1))
        naive = 2 * student * squares.std() / math.sqrt(len(squares))
        wider.append((got.high**2 - got.low**2) / naive)
        assert got.block >= got.correlation
    # squares of a Gaussian series have the autocorrelation phi^2k, so the mean's sigma grows by this
    assert np.mean(wider) == pytest.approx(math.sqrt((1 + 0.95**2) / (1 - 0.95**2)), rel=0.12)


def test_of_independent_rows_it_is_as_wide_as_the_ordinary_bootstrap():
    squares = np.random.default_rng(4).normal(size=3000) ** 2
    got, naive = block_interval(squares), mean_interval(squares)
    assert got.high**2 - got.low**2 == pytest.approx(naive.high - naive.low, rel=0.15)


def test_it_holds_the_true_rmse_95_times_in_100():
    """600 series: a standard error of 0.9 %; independent rows would hold it half the time."""
    held = [(i := block_interval(x)).low <= 1.0 <= i.high for x in autoregressive(0.8, 2000, 5, count=600) ** 2]
    assert 0.93 <= np.mean(held) <= 0.97


def test_the_rmse_is_that_of_the_rows_and_short_recordings_have_no_interval():
    squares = np.arange(1.0, 101.0)
    assert block_interval(squares).rmse == pytest.approx(math.sqrt(50.5))
    assert block_interval(squares) == block_interval(squares.copy())
    trend = np.linspace(0, 1, 100)
    got = block_interval(trend)
    assert math.isfinite(got.rmse)
    assert math.isnan(got.low)
    for nothing in (np.empty(0), np.array([1.0, np.nan])):
        assert math.isnan(block_interval(nothing).rmse)
    got = block_interval(np.full(100, 4.0))
    assert (got.low, got.rmse, got.high) == pytest.approx((2.0, 2.0, 2.0))


@pytest.mark.parametrize("times", [80, 150])
def test_it_holds_the_true_rmse_of_three_axes_down_to_75_correlation_times(times):
    """500 series: a standard error of 1 %. Squares of phi^k forget as phi^2k: tau = (1 + phi^2)/(1 - phi^2)."""
    tau = 4000 / times
    phi = math.sqrt((tau - 1) / (tau + 1))
    axes = autoregressive(phi, 4000, 6, count=1500) ** 2
    got = [block_interval(of_three) for of_three in axes.reshape(500, 3, 4000).sum(axis=1)]
    known = [i for i in got if not math.isnan(i.low)]
    assert len(known) > 300
    assert 0.91 <= np.mean([i.low <= math.sqrt(3) <= i.high for i in known]) <= 0.97


def test_below_75_correlation_times_it_is_too_short_to_say():
    phi = math.sqrt((100 - 1) / (100 + 1))
    got = [block_interval(x) for x in autoregressive(phi, 4000, 7, count=50) ** 2]
    assert all(math.isnan(i.low) == (75 * i.correlation > 4000) for i in got)
    assert np.mean([math.isnan(i.low) for i in got]) > 0.8
