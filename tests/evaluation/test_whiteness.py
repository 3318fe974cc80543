"""The chi-square band, and whiteness of the innovations of a correct filter and of filters with a wrong Q."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

from jerkbench.evaluation.correlated_errors import whiteness_of_rows
from jerkbench.evaluation.intervals import chi2_band


def whiteness(innovation):
    return whiteness_of_rows(innovation[:, None])[0]


def test_the_band_is_chi_squares():
    low, high = chi2_band(6, 50)
    assert chi2.cdf(low * 50, 300) == pytest.approx(0.025)
    assert chi2.cdf(high * 50, 300) == pytest.approx(0.975)
    draws = np.random.default_rng(3).chisquare(6, (20000, 50)).mean(axis=1)
    assert np.mean((draws > low) & (draws < high)) == pytest.approx(0.95, abs=0.005)


def test_white_noise_gives_uniform_p_and_few_innovations_say_nothing():
    p = [whiteness(y).p for y in np.random.default_rng(7).normal(size=(2000, 300))]
    assert np.mean(np.array(p) < 0.05) == pytest.approx(0.05, abs=0.02)
    assert np.mean(p) == pytest.approx(0.5, abs=0.03)
    got = whiteness(np.array([1.0, np.nan, 2.0]))
    assert math.isnan(got.p)
