"""The centres of many cells at once: each is that of scipy for its own runs."""

import numpy as np
import pytest
from scipy.stats import gmean, norm

from jerkbench.evaluation.intervals import quantiles_of_rows
from jerkbench.evaluation.over_seeds import GEOMETRIC, MEDIAN, Samples, centres
from roots import mean_ends


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


def test_cells_of_all_sizes_keep_their_order_and_have_their_own_centre(samples):
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


def test_beside_others_a_cell_has_the_bits_that_it_has_alone(samples):
    assert repr(list(centres(Samples.of(samples)))) == repr([centres(Samples.of([errors]))[0] for errors in samples])


def test_cells_without_scatter_without_value_and_with_a_lock_out():
    alike, empty, single, outlier = centres(Samples.of([[0.3] * 4, [np.nan] * 4, [0.2], [0.1, 0.1, 0.1, 5.0]]))
    assert (alike.kind, alike.value, alike.low, alike.high) == (GEOMETRIC, 0.3, 0.3, 0.3)
    assert np.isnan([empty.value, empty.low, empty.high, *quartiles_of(empty)]).all()
    assert single.value == 0.2
    assert np.isnan([single.low, single.high]).all()
    assert (outlier.kind, outlier.value, outlier.outlying) == (GEOMETRIC, pytest.approx(gmean([0.1, 0.1, 0.1, 5.0])), 1)
