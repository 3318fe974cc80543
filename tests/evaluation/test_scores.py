"""Scores and the response to a fault against independent computations."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.stats import norm

from jerkbench.evaluation.metrics.consistency import credibility, crps
from jerkbench.evaluation.metrics.recovery import step_response


@pytest.mark.parametrize(("error", "sigma"), [(0.0, 1.0), (0.7, 0.5), (-2.0, 0.3)])
def test_the_crps_is_the_integral_of_its_definition(error, sigma):
    below = quad(lambda x: norm.cdf(x, error, sigma) ** 2, -30, 0, points=[error], limit=400)[0]
    above = quad(lambda x: (1 - norm.cdf(x, error, sigma)) ** 2, 0, 30, points=[abs(error)], limit=400)[0]
    assert crps(np.array([error]), np.array([sigma]))[0] == pytest.approx(below + above, rel=1e-6)


def test_who_is_certain_is_scored_by_the_error():
    np.testing.assert_array_equal(crps(np.array([-2.0, 3.0]), np.zeros(2)), [2.0, 3.0])


def test_no_other_sigma_scores_better_than_the_true_one():
    errors = np.random.default_rng(1).standard_normal(40_000)
    scores = [crps(errors, np.full(40_000, sigma)).mean() for sigma in (0.7, 1.0, 1.4)]
    assert min(scores) == scores[1]


def test_a_covariance_ten_times_too_small_has_ten_decibels():
    nees = np.random.default_rng(2).chisquare(3, 500)
    assert credibility(10 * nees, nees)[0] == pytest.approx(10)
    assert credibility(0.1 * nees, nees)[1] == pytest.approx(-10)
    assert credibility(nees, nees)[0] == 0
    assert math.isnan(credibility(np.array([]), np.array([]))[0])


def test_an_exponential_halves_in_its_half_life():
    t_s = np.arange(0.0, 40.0, 0.01)
    error = np.where(t_s < 10, 0.0, np.exp(-(t_s - 10) / 5))
    found = step_response(t_s, error, 10.0, 40.0)
    assert found.peak == pytest.approx(1.0, abs=1e-2)
    assert found.halved_s == pytest.approx(5 * math.log(2), abs=0.02)


def test_halfway_back_is_between_the_peak_and_what_was_before():
    found = step_response(np.arange(6.0), np.array([1.0, 1.0, 5.0, 4.0, 2.9, 1.0]), 2.0, 10.0)
    assert found == (5.0, 2.0)


def test_an_error_that_stays_never_halves():
    found = step_response(np.arange(5.0), np.array([0.0, 0.0, 3.0, 3.0, 3.0]), 2.0, 10.0)
    assert math.isnan(found.halved_s)
    assert math.isnan(step_response(np.arange(5.0), np.ones(5), 7.0, 10.0).peak)
