"""Exact tests and intervals, compared with scipy, statsmodels and simulation."""

import math

import numpy as np
import pytest
from scipy.stats import beta, binomtest, gmean, norm, ttest_1samp

from jerkbench.evaluation.intervals import (
    GEOMETRIC,
    MEDIAN,
    SHRUNK,
    Samples,
    centres,
    failure_bound,
    failures_text,
    few_intervals,
    hall_intervals,
    median_intervals,
    quantiles_of_rows,
    share_interval,
    student_intervals,
)
from jerkbench.evaluation.judgement import median_p, sign_p
from roots import hall_ends, mean_ends


@pytest.mark.parametrize(("count", "n"), [(0, 5), (1, 20), (12, 20), (20, 20)])
def test_the_share_has_clopper_and_pearsons_interval(count, n):
    expected = binomtest(count, n).proportion_ci(0.95, method="exact")
    assert share_interval(count, n) == pytest.approx((expected.low, expected.high))


@pytest.mark.parametrize(("a", "b"), [(0, 0), (1, 0), (5, 5), (12, 0), (3, 11)])
def test_the_sign_test_is_mcnemars_exact_one(a, b):
    contingency = pytest.importorskip("statsmodels.stats.contingency_tables")
    expected = contingency.mcnemar([[3, a], [b, 4]], exact=True).pvalue if a + b else 1.0
    assert sign_p(a, b) == pytest.approx(expected)


def test_the_median_has_an_interval_from_five_values_on_with_lost_runs_at_the_top():
    assert np.isnan(median_intervals(np.arange(4.0)[None], 0.95)).all()
    assert median_intervals(np.arange(5.0)[None], 0.95) == (0.0, 4.0)
    values = np.arange(1.0, 12.0)
    ((low,), (high,)) = median_intervals(values[None], 0.95)
    assert 2 < low < 3
    assert 9 < high < 10
    assert low + high == pytest.approx(12)
    (found,) = centres(Samples.of([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, np.inf, np.inf, np.nan]]))
    assert (found.value, found.lower_quartile, found.upper_quartile, found.high) == (5.0, 3.0, 7.0, math.inf)
    assert quantiles_of_rows(np.array([[1.0, np.inf, np.inf]]))[0] == math.inf
    assert np.isnan(quantiles_of_rows(np.empty((1, 0)))).all()


@pytest.mark.parametrize(("count", "n"), [(0, 1), (0, 20), (3, 20), (19, 20), (20, 20)])
def test_the_bound_of_losses_is_the_one_sided_quantile_of_beta(count, n):
    assert failure_bound(count, n) == pytest.approx(beta.ppf(0.95, count + 1, n - count) if count < n else 1.0)


def test_losses_that_were_not_seen_are_bounded_in_words_and_excluded_by_99_seeds():
    assert failures_text(0, 0, 20) == "0 of 20 failed (up to 14 %)"
    assert failures_text(3, 0, 20) == "3 of 20 failed (up to 34 %)"
    assert failures_text(0, 0, 100) == "0 of 100 failed (up to 3.0 %)"
    assert failures_text(5, 0, 5) == "5 of 5 failed (up to 100 %)"
    assert failure_bound(0, 99) < 0.03 < failure_bound(0, 98)


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
    values = np.array([[-2.0, -1.0, 0.0, 1.0, 2.0], [3.0] * 5])
    assert np.transpose(few_intervals(values, 0.95)) == pytest.approx(np.transpose(student_intervals(values, 0.95)))
    assert np.isnan(few_intervals(np.zeros((1, 1)), 0.95)).all()


@pytest.mark.parametrize("n", [5, 6, 10])
@pytest.mark.parametrize("sign", [1, -1])
def test_it_covers_skewed_means_where_student_s_does_not(n, sign):
    values = sign * skewed(np.random.default_rng(n), (20_000, n))
    assert 0.93 < covered(few_intervals(values, 0.95)) < 0.97
    assert covered(student_intervals(values, 0.95)) < 0.93


def covered(ends):
    low, high = ends
    return np.mean((low <= 0) & (high >= 0))


def sample(rng, size, lost=0, missing=0):
    """Errors of ``size`` runs, of which some were lost and some have no value."""
    errors = rng.lognormal(0.0, 0.2, size)
    errors[:lost], errors[lost : lost + missing] = np.inf, np.nan
    return rng.permutation(errors)


@pytest.fixture
def samples():
    rng = np.random.default_rng(4)
    whole = [sample(rng, size) for size in (4, 20, 4, 7, 20)]
    return [*whole, *(sample(rng, 20, lost, missing) for lost, missing in ((3, 0), (0, 5), (12, 2), (2, 2)))]


def quartiles_of(centre):
    return centre.lower_quartile, centre.upper_quartile


def test_cells_of_all_sizes_have_the_centre_that_they_have_alone(samples):
    for errors, centre in zip(samples, centres(Samples.of(samples)), strict=True):
        kept = errors[~np.isnan(errors)]
        good = kept[np.isfinite(kept)]
        assert centre.geometric == pytest.approx(gmean(good), rel=1e-12)
        if len(errors) >= 6:
            assert (centre.kind, centre.value) == (MEDIAN, pytest.approx(np.median(kept), rel=1e-14))
            _, low, high, *quartiles = (column.item() for column in quantiles_of_rows(kept[None]))
            assert (centre.low, centre.high, *quartiles_of(centre)) == (low, high, *quartiles)
            continue
        expected = (gmean(good), *np.exp(mean_ends(np.log(good))))
        assert (centre.kind, (centre.value, centre.low, centre.high)) == (GEOMETRIC, pytest.approx(expected, rel=1e-12))
        assert quartiles_of(centre) == pytest.approx(tuple(np.quantile(kept, [0.25, 0.75])), rel=1e-14)
    assert repr(list(centres(Samples.of(samples)))) == repr([centres(Samples.of([errors]))[0] for errors in samples])


@pytest.mark.parametrize("share", [0.03, 0.1])
@pytest.mark.parametrize("seeds", [6, 10, 20])
def test_the_interval_that_is_shown_holds_the_median_of_a_mixture_with_lock_outs(share, seeds):
    """2000 cells: 95 % have a standard error of 0.5 %, and the interval of few values covers 94 to 97 %."""
    rng = np.random.default_rng(seeds)
    locked = rng.random((2000, seeds)) < share
    errors = np.exp(0.1 * rng.standard_normal((2000, seeds)) + np.log(50) * locked)
    truth = np.exp(0.1 * norm.ppf(0.5 / (1 - share)))
    held = [of.low <= truth <= of.high for of in centres(Samples.of(list(errors)))]
    assert 0.935 <= np.mean(held) <= 0.98


def test_cells_without_scatter_without_value_and_with_a_lock_out():
    alike, empty, single, outlier = centres(Samples.of([[0.3] * 4, [np.nan] * 4, [0.2], [0.1, 0.1, 0.1, 5.0]]))
    assert (alike.kind, alike.value, alike.low, alike.high) == (GEOMETRIC, 0.3, 0.3, 0.3)
    assert np.isnan([empty.value, empty.low, empty.high, *quartiles_of(empty)]).all()
    assert single.value == 0.2
    assert np.isnan([single.low, single.high]).all()
    assert (outlier.kind, outlier.value, outlier.outlying) == (GEOMETRIC, pytest.approx(gmean([0.1, 0.1, 0.1, 5.0])), 1)
