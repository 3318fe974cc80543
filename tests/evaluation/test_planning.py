"""Seeds to come: how many decide, and what each look at the results may spend."""

import math

import numpy as np
import pytest

from jerkbench.evaluation.statistics.judgement import MARGIN, Verdict, judged
from jerkbench.evaluation.statistics.log_ratio import log_ratios
from jerkbench.evaluation.statistics.max_t import max_t
from jerkbench.evaluation.statistics.seeds_needed import critical_t, seeds_needed
from jerkbench.evaluation.statistics.sequential import levels, looks


@pytest.mark.parametrize("truth", [1.0, 1.015, 1.1])
def test_the_seeds_that_are_named_decide_four_times_in_five(truth):
    """80 pilots of 10 seeds; the standard error of 80 % is 4.5 %."""
    rng = np.random.default_rng(4)
    decided = []
    for _ in range(80):
        first = math.log(truth) + 0.08 * rng.standard_normal(10)
        if judged([log_ratios(np.exp(first), np.ones(10))])[0].verdict is not Verdict.UNDECIDED:
            continue
        needed = seeds_needed(first, MARGIN)
        assert needed is not None
        d = np.concatenate([first, math.log(truth) + 0.08 * rng.standard_normal(needed - 10)])
        decided.append(judged([log_ratios(np.exp(d), np.ones(needed))])[0].verdict is not Verdict.UNDECIDED)
    assert np.mean(decided) >= 0.75


def test_more_scatter_and_more_comparisons_need_more_seeds():
    d = 0.02 + 0.1 * np.random.default_rng(5).standard_normal(10)
    few, many, scattered = seeds_needed(d, MARGIN), seeds_needed(d, MARGIN, 100), seeds_needed(3 * d, MARGIN)
    assert 10 < few < many
    assert few < scattered


def test_a_wider_margin_needs_fewer():
    d = 0.1 * np.random.default_rng(6).standard_normal(10)
    assert seeds_needed(d, 0.1) < seeds_needed(d, 0.03)


def test_nobody_runs_a_million_seeds():
    assert seeds_needed(30 * np.random.default_rng(7).standard_normal(10), 0.001) is None


def test_what_does_not_scatter_needs_no_more():
    assert seeds_needed(np.full(6, 0.1), MARGIN) == 6


@pytest.mark.parametrize(("n", "comparisons"), [(6, 1), (10, 1), (20, 1), (10, 60), (20, 60), (50, 60)])
def test_the_critical_value_to_plan_with_is_near_the_bootstraps(n, comparisons):
    rng = np.random.default_rng(8)
    seen = [max_t(rng.standard_normal((comparisons, n))).critical(0.05) for _ in range(40)]
    planned = critical_t(np.array([float(n)]), comparisons, 0.05)[0]
    assert planned == pytest.approx(np.median(seen), rel=0.12)


def test_looks_double_and_end_at_the_most():
    assert looks(400) == [20, 40, 80, 160, 320, 400]
    assert looks(40) == [20, 40]
    assert looks(10) == [10]


def test_all_looks_together_spend_the_level():
    spent = levels(looks(400))
    assert spent.sum() == pytest.approx(0.05)
    assert (spent > 0).all()


def test_the_level_that_was_spent_is_of_pococks_type():
    """Lan and DeMets: alpha(t) = 0.05 log(1 + (e - 1) t); at t = 0.2, 0.6 and 1 it is .0148, .0354 and .05."""
    np.testing.assert_allclose(np.cumsum(levels([20, 60, 100])), [0.01477, 0.03543, 0.05], atol=2e-5)


def test_no_number_of_seeds_is_named_that_nobody_runs():
    """About 15 000 seeds would tell, and nobody runs them."""
    d = 0.7 * np.random.default_rng(3).standard_normal(20)
    assert seeds_needed(d - d.mean(), MARGIN) is None
