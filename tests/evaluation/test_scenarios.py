"""Over scenarios: the mixed model against statsmodels, ranks, selection."""

import math
import warnings

import numpy as np
import pandas as pd
import pytest
from scipy.stats import t

from jerkbench.evaluation.drives_and_tunings import over_scenarios, rank_range


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
    half = (math.log(got.high) - math.log(got.low)) / 2 / t.ppf(0.975, got.dof)
    assert half == pytest.approx(float(fit.bse_fe.iloc[0]), rel=2e-3)


def test_what_no_scenario_changes_is_students_interval():
    """Without variances of scenarios and seeds all values are one sample."""
    d = drawn(5, 4, (0.0, 0.0, 0.1), seed=6)
    d -= d.mean(axis=1, keepdims=True)
    d = d - d.mean(axis=0) + 0.1
    got = over_scenarios(d)
    half = t.ppf(0.975, 19) * d.std(ddof=1) / math.sqrt(20)
    assert got.dof == 19.0
    assert (math.log(got.low), math.log(got.high)) == pytest.approx((0.1 - half, 0.1 + half))


def test_one_seed_leaves_the_scenarios_and_the_worst_is_named():
    d = drawn(9, 1)
    half = t.ppf(0.975, 8) * d.std(ddof=1) / 3
    assert math.log(over_scenarios(d).high) == pytest.approx(d.mean() + half)
    assert math.isnan(over_scenarios(drawn(1, 5)).low)
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


def test_ranks_that_are_sure_have_no_range():
    rng = np.random.default_rng(8)
    costs = np.array([0.0, 1.0, 1.0]) + 0.01 * rng.standard_normal((6, 5, 3))
    found = rank_range(costs)
    assert (found.rank[0], found.low[0], found.high[0]) == (1, 1, 1)
    assert (found.low[1], found.high[1]) == (2, 3)
