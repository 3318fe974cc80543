"""Over scenarios: the mixed model against statsmodels, ranks against scikit-posthocs and scipy, selection."""

import math
import warnings

import numpy as np
import pandas as pd
import pytest
from scipy.stats import kendalltau, t

from jerkbench.evaluation.ranks import (
    critical_difference,
    kendall_tau,
    mean_ranks,
    over_scenarios,
    performance_profile,
    rank_cliques,
    rank_range,
)
from jerkbench.report.sweeps import chosen_on_other_seeds


def drawn(scenarios, seeds, sigmas=(0.3, 0.15, 0.1), seed=3):
    rng = np.random.default_rng(seed)
    of_scenario, of_seed, rest = sigmas
    return (
        0.2
        + of_scenario * rng.standard_normal((scenarios, 1))
        + of_seed * rng.standard_normal((1, seeds))
        + rest * rng.standard_normal((scenarios, seeds))
    )


def test_the_closed_form_is_the_mixed_model():
    """Crossed random effects by restricted maximum likelihood, as statsmodels has them."""
    models = pytest.importorskip("statsmodels.regression.mixed_linear_model")
    d = drawn(8, 6)
    rows = pd.DataFrame(
        [(value, str(s), str(i), 1) for s, line in enumerate(d) for i, value in enumerate(line)],
        columns=["d", "scenario", "seed", "all"],
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # how it converged; the numbers below say whether
        fit = models.MixedLM.from_formula(
            "d ~ 1", groups="all", vc_formula={"scenario": "0 + C(scenario)", "seed": "0 + C(seed)"}, data=rows
        ).fit(reml=True, ftol=1e-14, gtol=1e-12)
    got = over_scenarios(d)
    assert math.log(got.ratio) == pytest.approx(float(fit.fe_params.iloc[0]), rel=1e-6)
    sigmas = np.sqrt([*fit.vcomp, fit.scale])
    np.testing.assert_allclose([got.scenario_sigma, got.seed_sigma, got.sigma], sigmas, rtol=2e-3)
    half = (math.log(got.high) - math.log(got.low)) / 2 / t.ppf(0.975, got.dof)
    assert half == pytest.approx(float(fit.bse_fe.iloc[0]), rel=2e-3)


def test_what_no_scenario_changes_is_students_interval():
    """Without variances of scenarios and seeds all values are one sample."""
    d = drawn(5, 4, (0.0, 0.0, 0.1), seed=6)
    d -= d.mean(axis=1, keepdims=True)
    d = d - d.mean(axis=0) + 0.1
    got = over_scenarios(d)
    half = t.ppf(0.975, 19) * d.std(ddof=1) / math.sqrt(20)
    assert (got.scenario_sigma, got.seed_sigma, got.dof) == (0.0, 0.0, 19.0)
    assert (math.log(got.low), math.log(got.high)) == pytest.approx((0.1 - half, 0.1 + half))


def test_one_seed_leaves_the_scenarios_and_one_scenario_has_no_interval():
    d = drawn(9, 1)
    half = t.ppf(0.975, 8) * d.std(ddof=1) / 3
    assert math.log(over_scenarios(d).high) == pytest.approx(d.mean() + half)
    assert math.isnan(over_scenarios(drawn(1, 5)).low)


def test_the_worst_scenario_is_named():
    d = drawn(6, 10)
    got = over_scenarios(d)
    assert (got.worst, got.worst_ratio) == (np.argmax(d.mean(axis=1)), pytest.approx(np.exp(d.mean(axis=1).max())))


def test_the_interval_over_scenarios_covers():
    """800 trials of 12 scenarios and 8 seeds: a standard error of 0.8 %."""
    hits = [
        math.log(got.low) <= 0.2 <= math.log(got.high)
        for got in (over_scenarios(drawn(12, 8, seed=seed)) for seed in range(800))
    ]
    assert 0.93 <= np.mean(hits) <= 0.97


def test_the_critical_difference_is_nemenyis():
    """Demšar's table 5 (a): q of 5 methods at 5 % is 2.728."""
    assert critical_difference(5, 30) == pytest.approx(2.728 * math.sqrt(5 * 6 / 180), rel=1e-3)


def test_methods_that_differ_critically_have_nemenyis_p_below_the_level():
    posthocs = pytest.importorskip("scikit_posthocs")
    costs = np.random.default_rng(4).standard_normal((12, 4)) + np.array([0.0, 0.5, 1.5, 2.5])
    p = posthocs.posthoc_nemenyi_friedman(costs).to_numpy()
    ranks = costs.argsort(axis=1).argsort(axis=1).mean(axis=0)
    apart = np.abs(ranks[:, None] - ranks) > critical_difference(4, 12)
    np.testing.assert_array_equal(apart, p < 0.05)


def test_cliques_are_the_longest_lines():
    found = rank_cliques(np.array([1.0, 4.0, 1.5, 2.4, 3.2]), 1.5)
    assert [list(group) for group in found] == [[0, 2, 3], [3, 4], [4, 1]]


def test_ranks_that_are_sure_have_no_range():
    rng = np.random.default_rng(8)
    costs = np.array([0.0, 1.0, 1.0]) + 0.01 * rng.standard_normal((6, 5, 3))
    found = rank_range(costs)
    assert (found.place[0], found.low[0], found.high[0]) == (1, 1, 1)
    assert (found.low[1], found.high[1]) == (2, 3)


def test_kendalls_tau_is_scipys():
    a, b = np.random.default_rng(9).standard_normal((2, 10))
    expected = kendalltau(a, b)
    assert kendall_tau(a, b) == pytest.approx((expected.statistic, expected.pvalue))
    assert all(map(math.isnan, kendall_tau(a[:2], b[:2])))


def test_the_best_of_many_equals_flatters_itself():
    """Of 20 equal settings the best looks better by a standard error or two; other seeds do not agree."""
    rng = np.random.default_rng(10)
    gaps, honest = [], []
    for _ in range(200):
        errors = np.exp(0.2 * rng.standard_normal((20, 10)))
        honest.append(np.log(errors[chosen_on_other_seeds(errors), np.arange(errors.shape[1])]).mean())
        gaps.append(np.log(errors).mean(axis=1).min())
    assert np.mean(gaps) < -0.1
    assert abs(np.mean(honest)) < 0.02


def test_a_setting_is_chosen_by_the_other_seeds_and_a_lost_run_costs_more_than_any_error():
    errors = np.array([[1.0, 1.0, 9.0], [2.0, 2.0, 2.0]])
    np.testing.assert_array_equal(chosen_on_other_seeds(errors), [1, 1, 0])
    errors = np.array([[1.0, 1.0, 1.0, np.inf], [5.0, 5.0, 5.0, 5.0]])
    np.testing.assert_array_equal(chosen_on_other_seeds(errors), [1, 1, 1, 0])
    assert chosen_on_other_seeds(errors[:, 3:]) == 1


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
