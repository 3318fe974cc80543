"""Seeds to come: how many decide, and what each look at the results may spend."""

import math

import numpy as np
import pytest
from scipy.stats import chi2, norm, ttest_1samp

from jerkbench.evaluation.judgement import Verdict, judged, log_ratios, max_t
from jerkbench.evaluation.planning import critical_t, interim_levels, interim_sizes, seeds_needed


def judge(d):
    return judged([log_ratios(np.exp(row), np.ones(len(row))) for row in d])


def test_the_seeds_that_are_named_decide_four_times_in_five():
    """Pilots of 10 seeds, each of 5 comparisons; wherever in its interval the truth lies, so mostly more often."""
    rng, truth = np.random.default_rng(4), 1.12
    decided = []
    while len(decided) < 15:
        first = math.log(truth) + 0.08 * rng.standard_normal((5, 10))
        if seeds_needed(first[0], 5) is None:
            continue
        before = judge(first)[0]
        if before.verdict is Verdict.UNDECIDED:
            needed = seeds_needed(first[0], 5, critical=before.critical)
            more = math.log(truth) + 0.08 * rng.standard_normal((5, needed - 10))
            decided.append(judge(np.hstack([first, more]))[0].verdict is not Verdict.UNDECIDED)
    assert np.mean(decided) >= 0.8


def test_no_seeds_are_named_where_only_equality_could_be_shown():
    """Of 400 pilots of equal methods at most 5 % have an interval without 1, by chance: the others have no number."""
    rng = np.random.default_rng(4)
    named = [seeds_needed(0.08 * rng.standard_normal(10)) is not None for _ in range(400)]
    assert np.mean(named) <= 0.07


def test_more_scatter_and_more_comparisons_need_more_seeds_up_to_what_anybody_runs():
    d = np.random.default_rng(5).standard_normal(10)
    d = (d - d.mean()) / d.std(ddof=1)
    few, many, scattered = seeds_needed(0.1 + 0.1 * d), seeds_needed(0.1 + 0.1 * d, 100), seeds_needed(0.1 + 0.12 * d)
    assert 10 < few < many
    assert few < scattered
    assert seeds_needed(np.full(6, 0.1)) == 6
    assert seeds_needed(np.zeros(6)) is None
    d = 0.7 * np.random.default_rng(3).standard_normal(20)
    half = d.mean() - ttest_1samp(d, 0).confidence_interval(0.95).low
    assert seeds_needed(d - d.mean() + 1.01 * half) is None
    assert seeds_needed(d - d.mean() + 2 * half) is not None


def test_the_seeds_are_those_of_the_power_of_the_end_that_is_nearest_to_none():
    """By scipy: of N seeds the mean is c standard errors away from 0 in 80 %, of 1.06 times fewer it is not."""
    d = np.random.default_rng(5).standard_normal(12)
    d = 0.08 + 0.1 * (d - d.mean()) / d.std(ddof=1)
    nearest = ttest_1samp(d, 0).confidence_interval(0.95).low
    s = 0.1 * np.sqrt(11 / chi2.ppf(0.2, 11))
    needed = seeds_needed(d)
    powers = [
        norm.sf(critical_t(np.array([n]), 1, 0.05)[0] - nearest * np.sqrt(n) / s) for n in (needed, needed / 1.06)
    ]
    assert powers[1] < 0.8 <= powers[0]


@pytest.mark.parametrize(("n", "comparisons"), [(6, 1), (10, 1), (20, 1), (10, 60), (20, 60), (50, 60)])
def test_the_critical_value_to_plan_with_is_near_the_bootstraps(n, comparisons):
    rng = np.random.default_rng(8)
    seen = [max_t(rng.standard_normal((comparisons, n))).critical(0.05) for _ in range(12)]
    planned = critical_t(np.array([float(n)]), comparisons, 0.05)[0]
    assert planned == pytest.approx(np.median(seen), rel=0.12)


def test_interim_analyses_double_and_together_spend_the_level_by_pococks_type():
    assert interim_sizes(400) == [20, 40, 80, 160, 320, 400]
    assert interim_sizes(40) == [20, 40]
    assert interim_sizes(10) == [10]
    spent = interim_levels(interim_sizes(400))
    assert spent.sum() == pytest.approx(0.05)
    assert (spent > 0).all()
    np.testing.assert_allclose(np.cumsum(interim_levels([20, 60, 100])), [0.01477, 0.03543, 0.05], atol=2e-5)
