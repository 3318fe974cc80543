"""Scores, the bound, the response to a fault and the noise of the reference against independent computations."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import solve_discrete_are
from scipy.stats import norm

from jerkbench.evaluation.statistics.cramer_rao import Step, posterior_bounds
from jerkbench.evaluation.statistics.gaussian_scores import crps, inclination_indicator, non_credibility_index
from jerkbench.evaluation.statistics.noisy_reference import without_reference_noise
from jerkbench.evaluation.statistics.step_response import step_response


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
    assert non_credibility_index(10 * nees, nees) == pytest.approx(10)
    assert inclination_indicator(0.1 * nees, nees) == pytest.approx(-10)
    assert non_credibility_index(nees, nees) == 0
    assert math.isnan(non_credibility_index(np.array([]), np.array([])))


def test_the_bound_settles_at_scipys_riccati_solution():
    dt = 0.1
    F = np.array([[1, dt], [0, 1]])
    Q = 0.3 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    H, R = np.array([[1.0, 0.0]]), np.array([[0.04]])
    prior = solve_discrete_are(F.T, H.T, Q, R)
    expected = np.linalg.inv(np.linalg.inv(prior) + H.T @ np.linalg.inv(R) @ H)
    bounds = posterior_bounds(np.eye(2), [Step(F, Q, H, R)] * 400)
    np.testing.assert_allclose(bounds[-1], expected, rtol=1e-9)


def test_no_linear_filter_beats_the_bound():
    """4000 runs of the filter that knows all: its mean square error is the bound."""
    rng = np.random.default_rng(3)
    F, Q, H, R = np.array([[0.9]]), np.array([[0.5]]), np.array([[1.0]]), np.array([[2.0]])
    bound = posterior_bounds(np.array([[1.0]]), [Step(F, Q, H, R)] * 30)[-1, 0, 0]
    x, estimate, P = rng.standard_normal(4000), np.zeros(4000), 1.0
    for _ in range(30):
        x = 0.9 * x + math.sqrt(0.5) * rng.standard_normal(4000)
        prior = 0.81 * P + 0.5
        gain = prior / (prior + 2.0)
        estimate = 0.9 * estimate
        estimate += gain * (x + math.sqrt(2.0) * rng.standard_normal(4000) - estimate)
        P = (1 - gain) * prior
    assert np.mean((x - estimate) ** 2) == pytest.approx(bound, rel=0.06)


def test_without_a_measurement_the_bound_grows():
    step = Step(np.eye(1), np.array([[0.1]]), np.empty((0, 1)), np.empty((0, 0)))
    np.testing.assert_allclose(posterior_bounds(np.eye(1), [step] * 3)[:, 0, 0], [1.1, 1.2, 1.3])


def test_an_exponential_halves_in_its_half_life():
    t_s = np.arange(0.0, 40.0, 0.01)
    error = np.where(t_s < 10, 0.0, np.exp(-(t_s - 10) / 5))
    found = step_response(t_s, error, 10.0, 40.0)
    assert found.peak == pytest.approx(1.0, abs=1e-2)
    assert found.halved_s == pytest.approx(5 * math.log(2), abs=0.02)
    assert found.peak_s == pytest.approx(0.0, abs=0.02)


def test_halfway_back_is_between_the_peak_and_what_was_before():
    found = step_response(np.arange(6.0), np.array([1.0, 1.0, 5.0, 4.0, 2.9, 1.0]), 2.0, 10.0)
    assert (found.before, found.peak, found.halved_s) == (1.0, 5.0, 2.0)


def test_an_error_that_stays_never_halves():
    found = step_response(np.arange(5.0), np.array([0.0, 0.0, 3.0, 3.0, 3.0]), 2.0, 10.0)
    assert math.isnan(found.halved_s)
    assert math.isnan(step_response(np.arange(5.0), np.ones(5), 7.0, 10.0).peak)


def test_the_references_noise_is_taken_out():
    rng = np.random.default_rng(4)
    error = 0.03 * rng.standard_normal((20_000, 3)) - 0.02 * rng.standard_normal((20_000, 3))
    found = without_reference_noise(np.sum(error**2, axis=1), np.full(20_000, 3 * 0.02**2))
    assert found.raw.rmse == pytest.approx(math.sqrt(3 * 0.0013), rel=0.01)
    assert found.own == pytest.approx(math.sqrt(3) * 0.03, rel=0.01)
    assert found.low < math.sqrt(3) * 0.03 < found.high
    assert found.sigma == pytest.approx(math.sqrt(3) * 0.02)


def test_a_reference_that_explains_everything_leaves_nothing():
    found = without_reference_noise(np.full(500, 1.0), np.full(500, 2.0))
    assert found.own == 0.0
