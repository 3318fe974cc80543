"""The chi-square band, and whiteness of the innovations of a correct filter and of filters with a wrong Q."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

from jerkbench.evaluation.correlated_errors import whiteness_of_rows
from jerkbench.evaluation.over_seeds import chi2_band

A = np.array([[1.0, 0.1], [0.0, 1.0]])
Q = np.array([[0.1**3 / 3, 0.1**2 / 2], [0.1**2 / 2, 0.1]])
H = np.array([[1.0, 0.0]])
STEPS = 300


def whiteness(innovation):
    return whiteness_of_rows(innovation[:, None])[0]


def simulate(runs, seed, factor=1.0):
    """Run a constant-velocity filter whose Q is ``factor`` times the true one; return its innovations (runs, steps)."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(runs, 2))
    m, P = np.zeros((runs, 2)), np.eye(2)
    innovations = []
    for _ in range(STEPS):
        x = x @ A.T + rng.multivariate_normal(np.zeros(2), Q, runs)
        m, P = m @ A.T, A @ P @ A.T + factor * Q
        S = H @ P @ H.T + 0.25
        y = x[:, :1] + 0.5 * rng.normal(size=(runs, 1)) - m[:, :1]
        K = P @ H.T / S
        m, P = m + y @ K.T, P - K @ H @ P
        innovations.append(y[:, 0])
    burn = 20
    return np.array(innovations)[burn:].T


def test_the_band_is_chi_squares():
    low, high = chi2_band(6, 50)
    assert chi2.cdf(low * 50, 300) == pytest.approx(0.025)
    assert chi2.cdf(high * 50, 300) == pytest.approx(0.975)
    draws = np.random.default_rng(3).chisquare(6, (20000, 50)).mean(axis=1)
    assert np.mean((draws > low) & (draws < high)) == pytest.approx(0.95, abs=0.005)


def test_innovations_of_a_matched_filter_are_white_and_of_a_mismatched_one_are_not():
    right, wrong = simulate(200, 5), simulate(40, 6, 0.05)
    assert np.mean([whiteness(y).white for y in right]) == pytest.approx(0.95, abs=0.05)
    assert np.mean([whiteness(y).white for y in wrong]) < 0.05
    assert whiteness(wrong[0]).first > 1.96 / np.sqrt(len(wrong[0]))


def test_white_noise_gives_uniform_p_and_few_innovations_say_nothing():
    p = [whiteness(y).p for y in np.random.default_rng(7).normal(size=(2000, 300))]
    assert np.mean(np.array(p) < 0.05) == pytest.approx(0.05, abs=0.02)
    assert np.mean(p) == pytest.approx(0.5, abs=0.03)
    got = whiteness(np.array([1.0, np.nan, 2.0]))
    assert math.isnan(got.p)
