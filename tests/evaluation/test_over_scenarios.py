"""Ranks and performance profiles against loops and cases that can be done by hand."""

import math

import numpy as np

from jerkbench.evaluation.ranks import mean_ranks, performance_profile

COSTS = np.array([[1.0, 2.0, 4.0], [3.0, 3.0, np.nan], [8.0, 2.0, 2.0], [np.inf, np.inf, np.nan]])


def test_ranks_share_ties_and_put_what_diverged_last():
    np.testing.assert_allclose(
        mean_ranks(COSTS), [(1 + 1.5 + 3 + 2) / 4, (2 + 1.5 + 1.5 + 2) / 4, (3 + 3 + 1.5 + 2) / 4]
    )


def test_the_profile_is_the_naive_count():
    factors = np.array([1.0, 1.9, 2.0, 4.0, 1e9])
    expected = [
        [
            sum(math.isfinite(c[s]) and c[s] <= tau * min(x for x in c if math.isfinite(x)) for c in COSTS[:3]) / 4
            for tau in factors
        ]
        for s in range(3)
    ]
    np.testing.assert_allclose(performance_profile(COSTS, factors), expected)


def test_an_error_of_nothing_is_the_best():
    np.testing.assert_allclose(performance_profile(np.array([[0.0, 1.0]]), np.array([1.0, 100.0])), [[1, 1], [0, 0]])
