"""Consistency verdicts and whiteness on a Kalman filter that is right, and on filters that are wrong on purpose."""

import math

import numpy as np
import pytest
from scipy.stats import chi2

from jerkbench.evaluation.correlated_errors import whiteness_of_rows
from jerkbench.evaluation.over_seeds import chi2_band, runs_verdict

A = np.array([[1.0, 0.1], [0.0, 1.0]])
Q = np.array([[0.1**3 / 3, 0.1**2 / 2], [0.1**2 / 2, 0.1]])
H = np.array([[1.0, 0.0]])
STEPS = 300


def whiteness(innovation):
    return whiteness_of_rows(innovation[:, None])[0]


def simulate(runs, seed, factor=1.0):
    """Run a constant-velocity filter whose Q is ``factor`` times the true one; return NEES and innovations."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(runs, 2))
    m, P = np.zeros((runs, 2)), np.eye(2)
    nees, innovations = [], []
    for _ in range(STEPS):
        x = x @ A.T + rng.multivariate_normal(np.zeros(2), Q, runs)
        m, P = m @ A.T, A @ P @ A.T + factor * Q
        S = H @ P @ H.T + 0.25
        y = x[:, :1] + 0.5 * rng.normal(size=(runs, 1)) - m[:, :1]
        K = P @ H.T / S
        m, P = m + y @ K.T, P - K @ H @ P
        e = x - m
        nees.append(np.einsum("ri,ij,rj->r", e, np.linalg.inv(P), e))
        innovations.append(y[:, 0])
    burn = 20
    return (np.array(series)[burn:].T for series in (nees, innovations))


@pytest.mark.parametrize(("factor", "word"), [(1.0, "consistent"), (0.05, "overconfident"), (20.0, "too cautious")])
def test_the_verdict_is_right_on_a_matched_and_on_mismatched_filters(factor, word):
    nees, _ = simulate(20, 1, factor)
    assert runs_verdict(nees.mean(axis=1), 2) == word


def test_a_matched_filter_is_seldom_called_wrong():
    """240 studies of 5 runs each: 5 % have a standard error of 1.4 %; errors that follow each other would give 40 %."""
    nees, _ = simulate(1200, 2)
    studies = [slice(5 * k, 5 * k + 5) for k in range(240)]
    wrong_runs = np.mean([runs_verdict(nees[s].mean(axis=1), 2) != "consistent" for s in studies])
    low, high = chi2_band(2, nees[0].size * 5)
    naive = np.mean([not low <= nees[s].mean() <= high for s in studies])
    assert wrong_runs <= 0.09
    assert naive > 0.3


def test_the_band_is_chi_squares():
    low, high = chi2_band(6, 50)
    assert chi2.cdf(low * 50, 300) == pytest.approx(0.025)
    assert chi2.cdf(high * 50, 300) == pytest.approx(0.975)
    draws = np.random.default_rng(3).chisquare(6, (20000, 50)).mean(axis=1)
    assert np.mean((draws > low) & (draws < high)) == pytest.approx(0.95, abs=0.005)


def test_the_word_for_few_runs():
    assert runs_verdict([], 6) == "not known"
    assert runs_verdict([5.9], 6) == "not known"
    assert runs_verdict([0.5, 6.0, 30.0], 6) == "not known"
    assert runs_verdict([0.1, 0.5, 2.0, 6.0, 60.0, 90.0], 6) == "not known"
    assert runs_verdict([0.0, 0.0, 1.0], 6) == "not known"
    assert runs_verdict([5.5, 6.1, 6.6], 6) == "consistent"
    assert runs_verdict([3.7, 4.0, 4.2], 6) == "too cautious"


# Three seeds of filters that are hundreds of times too sure of themselves: Student's interval of the mean holds 6.
@pytest.mark.parametrize(
    "averages", [(1073, 2910, 8605), (130, 250, 1068), (142, 271, 763), (102, 156, 306), (1073, 2910, 8605, 40, 9000)]
)
def test_what_no_test_rejects_is_not_consistent_for_that(averages):
    assert runs_verdict(averages, 6) == "overconfident"


def test_runs_that_were_lost_are_none_of_the_consistent_ones():
    for averages in ([5.5, 6.1, 6.6, 6.0, 5.8], [3.7, 4.0, 4.2, 4.0, 3.9]):
        assert runs_verdict(averages, 6) != "not known"
        assert runs_verdict(averages, 6, failed=1) == "not known"
        assert runs_verdict([*averages, np.inf], 6) == "not known"
        assert runs_verdict([*averages, np.nan], 6) == "not known"
    assert runs_verdict([500.0, 600.0, 700.0, 800.0, 550.0], 6, failed=2) == "overconfident"


@pytest.mark.parametrize("runs", [2, 3, 4, 5, 10, 40])
def test_a_consistent_filter_whose_runs_scatter_is_seldom_called_wrong(runs):
    """1000 studies of averages that scatter by 30 %: 5 % have a standard error of 0.7 %; BCa of five has 7 %."""
    draws = np.random.default_rng(8).gamma(11.0, 6 / 11.0, (1000, runs))
    words = [runs_verdict(values, 6) for values in draws]
    assert np.mean([word in ("overconfident", "too cautious") for word in words]) <= 0.09


def test_innovations_of_a_matched_filter_are_white_and_of_a_mismatched_one_are_not():
    _, right = simulate(200, 5)
    _, wrong = simulate(40, 6, 0.05)
    assert np.mean([whiteness(y).white for y in right]) == pytest.approx(0.95, abs=0.05)
    assert np.mean([whiteness(y).white for y in wrong]) < 0.05
    assert whiteness(wrong[0]).first > 1.96 / np.sqrt(len(wrong[0]))


def test_white_noise_gives_uniform_p_and_few_innovations_say_nothing():
    p = [whiteness(y).p for y in np.random.default_rng(7).normal(size=(2000, 300))]
    assert np.mean(np.array(p) < 0.05) == pytest.approx(0.05, abs=0.02)
    assert np.mean(p) == pytest.approx(0.5, abs=0.03)
    got = whiteness(np.array([1.0, np.nan, 2.0]))
    assert math.isnan(got.p)
