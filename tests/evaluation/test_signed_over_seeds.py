"""The interval of a mean against an independent BCa bootstrap, a closed form, and its own promises."""

import math

import numpy as np
import pytest
from scipy.stats import bootstrap, norm, ttest_1samp
from scipy.stats import t as student
from signed_intervals import Interval, mean_interval

from jerkbench.evaluation import intervals
from jerkbench.evaluation.intervals import Samples, bca_ends, mean_intervals


@pytest.mark.parametrize("confidence", [0.8, 0.95])
def test_it_is_the_bca_interval(confidence, monkeypatch):
    """The upper end's standard deviation from draw to draw is 0.5 % of the width with so many resamples (measured)."""
    monkeypatch.setattr(intervals, "_RESAMPLES", 200_000)
    values = np.random.default_rng(4).lognormal(sigma=1.0, size=20)  # skewed: percentile and BCa differ
    z = student.ppf((1 + confidence) / 2, 19) * math.sqrt(20 / 19)
    widened, rng = 2 * norm.cdf(z) - 1, np.random.default_rng(5)
    low, high = bootstrap(
        (values,), np.mean, n_resamples=200_000, confidence_level=widened, method="BCa", rng=rng
    ).confidence_interval
    interval = mean_interval(values, confidence)
    assert interval.mean == pytest.approx(values.mean())
    assert interval.low == pytest.approx(low, abs=0.03 * (high - low))
    assert interval.high == pytest.approx(high, abs=0.03 * (high - low))


@pytest.mark.parametrize("n", [2, 20, 61])  # of 5 values every 26th resample is a tie, which scipy leaves to rounding
def test_of_the_same_resamples_scipy_has_the_same_ends(n):
    values = np.random.default_rng(8).lognormal(sigma=0.5, size=(7, n))
    values = (values - values.mean(axis=1, keepdims=True)) / np.ptp(values, axis=1, keepdims=True)
    rng = np.random.default_rng(9)
    wanted = bootstrap(
        (values,), np.mean, axis=-1, n_resamples=999, confidence_level=0.9, method="BCa", rng=rng
    ).confidence_interval

    low, high = bca_ends(values, 0.9, 999, seed=9)
    np.testing.assert_allclose(low, wanted.low, rtol=0, atol=1e-12)
    np.testing.assert_allclose(high, wanted.high, rtol=0, atol=1e-12)


@pytest.mark.parametrize("n", [4, 5, 6])
def test_it_moves_and_stretches_with_the_values(n):
    """So a resample that holds each value once counts as equal to the mean, whatever rounding makes of its sum."""
    rng = np.random.default_rng(10)
    for values in rng.lognormal(sigma=0.3, size=(40, n)):
        here, there = mean_interval(values), mean_interval(3.0 * values + 0.7)
        assert (there.low, there.high) == pytest.approx((3.0 * here.low + 0.7, 3.0 * here.high + 0.7), rel=1e-9)


@pytest.mark.parametrize(("n", "sigma"), [(10, 0.2), (20, 0.01)])
def test_it_holds_the_true_mean_95_times_in_100(n, sigma):
    """RMSEs over seeds scatter like a lognormal; 2000 trials: a standard error of 0.5 %."""
    samples = np.random.default_rng(6).lognormal(0.0, sigma, size=(2000, n))
    _, low, high = mean_intervals(Samples.of(list(samples)))
    assert 0.93 <= np.mean((low <= math.exp(sigma**2 / 2)) & (math.exp(sigma**2 / 2) <= high)) <= 0.97


@pytest.mark.parametrize(
    ("values", "mean", "end"),
    [
        ([0.3], 0.3, math.nan),
        ([], math.nan, math.nan),
        ([0.1] * 7, 0.1, 0.1),
        ([1.0, math.inf], math.inf, math.nan),
        ([1e307, 1.6e308], 8.5e307, math.nan),  # an end beyond all numbers
    ],
)
def test_samples_without_scatter_or_without_finite_ends(values, mean, end):
    assert tuple(mean_interval(values)) == pytest.approx((mean, end, end), nan_ok=True)


def test_nan_is_left_out_and_of_an_infinite_spread_there_is_no_interval():
    assert mean_interval([1.0, math.nan, 2.0, 4.0]) == mean_interval([1.0, 2.0, 4.0])
    good, wide = map(Interval._make, np.transpose(mean_intervals(Samples.of([[1.0, 2.0], [-1e308, 1e308]]))))
    assert good == mean_interval([1.0, 2.0])
    assert wide.mean == 0.0
    assert math.isnan(wide.low)


@pytest.mark.parametrize(
    "values", [[1.0, 2.0], [1.0, 1.0 + 1e-15], [1e-300, 2e-300, 5e-300], [0, 0, 0, 1], [-1, 1], [1e9, 1e9 + 1e-6, 1e9]]
)
def test_odd_samples_warn_of_nothing_and_contain_their_mean(values):
    interval = mean_interval(values)
    assert interval.low <= interval.mean <= interval.high  # of fewer than five values Student's may lie outside them


def test_ends_stay_within_the_values_and_neither_order_nor_company_changes_them():
    """Rounding gave errors of which none is negative an interval from -7e-18 on."""
    rng = np.random.default_rng(11)
    for n in (5, 7):
        samples = rng.choice([0.0, 0.1, 0.2, 0.3], size=(300, n))
        samples = samples[np.ptp(samples, axis=1) > 0]
        _, low, high = mean_intervals(Samples.of(list(samples)))
        assert ((samples.min(axis=1) <= low) & (low <= high) & (high <= samples.max(axis=1))).all()
    rng = np.random.default_rng(7)
    samples = [rng.gamma(2.0, size=n) for n in (20, 5, 20, 1, 20) + (20,) * 40]
    together = np.transpose(mean_intervals(Samples.of(samples)))
    for k in (0, 1, 2, 4, 40):
        alone = mean_interval(samples[k][::-1])
        assert tuple(together[k]) == pytest.approx(tuple(alone), rel=1e-12, nan_ok=True)


def test_of_thousands_of_values_the_interval_is_the_one_that_scipy_gives_without_a_bootstrap():
    values = np.random.default_rng(3).exponential(2.0, 5000)
    wanted = ttest_1samp(values, 0.0).confidence_interval(0.95)
    found = mean_interval(values)

    assert (found.low, found.high) == pytest.approx((wanted.low, wanted.high), rel=1e-12)
    few = mean_interval(values[:1999])
    bounds = ttest_1samp(values[:1999], 0.0).confidence_interval(0.95)
    assert (few.low, few.high) == pytest.approx((bounds.low, bounds.high), abs=0.05 * (bounds.high - bounds.low))


@pytest.mark.parametrize("n", [2, 3, 4])
def test_few_values_have_students_interval(n):
    values = np.random.default_rng(n).normal(1.0, 0.1, n)
    ends = ttest_1samp(values, 0).confidence_interval(0.95)
    got = mean_interval(values)
    assert (got.low, got.high) == pytest.approx((ends.low, ends.high))
