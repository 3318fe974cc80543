"""Comparisons on other seeds, against scipy and by simulation."""

import math

import numpy as np
import pytest
from scipy.stats import bootstrap, fisher_exact, ttest_ind

from jerkbench.evaluation.families import max_t_of_two
from jerkbench.evaluation.judgement import Verdict, judged_on_other_seeds
from jerkbench.evaluation.over_seeds import two_samples


def judge(a, b, **options):
    (judgement,) = judged_on_other_seeds([two_samples(a, b)], **options)
    return judgement


@pytest.fixture
def rng():
    return np.random.default_rng(16)


def test_the_interval_has_welchs_standard_error_and_the_critical_value_of_the_study(rng):
    a, b = rng.lognormal(size=15), rng.lognormal(size=11)
    test = ttest_ind(np.log(a), np.log(b), equal_var=False)
    centre = np.log(a).mean() - np.log(b).mean()
    judgement = judge(a, b)
    half = judgement.critical * centre / test.statistic
    expected = tuple(np.exp(centre + np.array([0, -half, half])))
    assert (judgement.ratio, judgement.low, judgement.high) == pytest.approx(expected)
    assert judgement.n == 11
    assert (judgement.p < 0.05) is not (judgement.low <= 1 <= judgement.high)


def test_losses_are_those_of_samples_of_their_own(rng):
    a, b = rng.lognormal(size=20), rng.lognormal(size=10)
    a[:12] = np.inf
    assert judge(a, b).losses == "12 of 20 lost (up to 78 %) against 0 of 10 lost (up to 26 %)"
    assert judge(a, b).turned.losses == judge(b, a).losses


def test_the_critical_value_of_one_comparison_is_that_of_scipys_resamples(rng):
    """The 95 % points of Welch's t, of scipy's bootstrap and of ours, agree to the scatter of 5000 draws."""
    a, b = rng.standard_normal(14), 2 * rng.standard_normal(9)
    drawn = bootstrap(
        (a - a.mean(), b - b.mean()),
        lambda x, y, axis: ttest_ind(x, y, equal_var=False, axis=axis).statistic,
        n_resamples=5000,
        method="percentile",
        rng=rng,
    )
    expected = np.quantile(np.abs(drawn.bootstrap_distribution), 0.95)
    assert max_t_of_two(a[None], b[None]).critical(0.05)[0] == pytest.approx(expected, rel=0.06)


def test_better_equal_worse_and_undecided(rng):
    def scatter(sigma):
        return np.exp(sigma * rng.standard_normal(100))

    cases = [(0.9, 0.02), (1.005, 0.01), (1.2, 0.02), (1.0, 0.5)]
    judgements = judged_on_other_seeds([two_samples(ratio * scatter(sigma), scatter(sigma)) for ratio, sigma in cases])
    expected = [Verdict.BETTER, Verdict.EQUAL, Verdict.WORSE, Verdict.UNDECIDED]
    assert [judgement.verdict for judgement in judgements] == expected


def test_twelve_lost_of_twenty_runs_are_never_better(rng):
    risky, base = np.full(20, 1e-3), np.exp(0.3 * rng.standard_normal(20))
    risky[:12] = np.inf
    judgement = judge(risky, base)
    assert judgement.verdict is Verdict.MORE_LOST
    assert judgement.p_lost == pytest.approx(2 * fisher_exact([[12, 8], [0, 20]]).pvalue)
    assert judgement.ratio == math.inf


def test_medians_are_compared_where_runs_are_lost(rng):
    a, b = np.exp(0.05 * rng.standard_normal((2, 20)))
    b *= 2
    b[0] = np.inf
    judgement = judge(a, b)
    assert judgement.verdict is Verdict.BETTER
    assert judgement.p == pytest.approx(2 * fisher_exact([[0, 20], [20, 0]]).pvalue)


def test_of_fewer_than_six_seeds_nothing_is_decided(rng):
    assert judge(np.exp(0.01 * rng.standard_normal(5)), np.full(40, 9.0)).verdict is Verdict.UNDECIDED
    assert judge([], [1.0]).n == 0


@pytest.mark.parametrize("sizes", [(8, 8), (20, 10)])
def test_few_sets_of_equal_results_have_a_false_verdict(rng, sizes):
    """300 sets of 6 combinations, of which three have skewed errors: 5 % have a standard error of 1.3 %."""
    wrong = 0
    for _ in range(300):
        a, b = (np.exp(0.2 * rng.standard_normal((6, n))) for n in sizes)
        a[:3], b[:3] = np.exp(a[:3] ** 3), np.exp(b[:3] ** 3)
        judgements = judged_on_other_seeds([two_samples(*of) for of in zip(a, b, strict=True)])
        wrong += any(judgement.verdict in {Verdict.BETTER, Verdict.WORSE} for judgement in judgements)
    assert wrong / 300 <= 0.075
