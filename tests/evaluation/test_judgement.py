"""Verdicts: what they say of cases whose truth is known, and how seldom they are wrong."""

import math

import numpy as np
import pytest
from scipy.stats import binomtest, pareto, sem, ttest_1samp

from jerkbench.evaluation.judgement import _RESAMPLES, _SEED, DEFEATS, WINS, Verdict, judged, log_ratios, max_t


def scatter(rng, sigma, n=20):
    return np.exp(sigma * rng.standard_normal(n))


def judge(a, b, **options):
    (found,) = judged([log_ratios(a, b)], **options)
    return found


@pytest.fixture
def rng():
    return np.random.default_rng(14)


def test_the_verdicts_of_known_ratios(rng):
    base = scatter(rng, 0.5, 100)
    ratios = {Verdict.BETTER: 0.9, Verdict.SMALL: 0.985, Verdict.EQUAL: 1.001, Verdict.WORSE: 1.2, Verdict.UNDECIDED: 1}
    cases = [ratio * scatter(rng, 0.3 if ratio == 1 else 0.02, 100) for ratio in ratios.values()]
    found = judged([log_ratios(base * case, base) for case in cases])
    assert [one.verdict for one in found] == list(ratios)
    assert judged([log_ratios(base, base * case) for case in cases])[0].verdict is Verdict.WORSE


def test_the_interval_is_the_mean_of_the_logarithms_and_the_critical_t_of_the_study(rng):
    a, b = scatter(rng, 0.2, 9), scatter(rng, 0.2, 9)
    d = np.log(a / b)
    half = max_t(d[None]).critical(0.05)[0] * sem(d)
    found = judge(a, b)
    assert (found.ratio, found.low, found.high) == pytest.approx(tuple(np.exp(d.mean() + np.array([0, -half, half]))))


def test_the_interval_that_is_shown_is_the_one_that_decides():
    """Of 2400 comparisons, with and without lost runs and lock-outs: better and worse are those whose ends say so."""
    rng = np.random.default_rng(26)
    seen = dict.fromkeys(Verdict, 0)
    for size in (3, 40, 3, 40, 3, 40) * 18 + (1,) * 78:
        ratios = np.exp(0.12 * rng.standard_normal((size, 24)) + 0.1 * rng.standard_normal((size, 1)))
        ratios[rng.random(ratios.shape) < 0.01] = np.inf
        ratios[rng.random(ratios.shape) < 0.01] *= 50
        for found in judged([log_ratios(row, np.ones(24)) for row in ratios]):
            seen[found.verdict] += 1
            if found.verdict in {Verdict.BETTER, Verdict.WORSE}:
                assert (found.high < 1) if found.verdict is Verdict.BETTER else (found.low > 1)
            elif found.verdict is Verdict.SMALL:
                assert 1 / 1.03 < found.low <= found.high < 1.03
                assert not found.low <= 1 <= found.high
            elif found.verdict is Verdict.UNDECIDED and not found.reason:
                assert math.isnan(found.low) or found.low <= 1 <= found.high
    assert min(seen[verdict] for verdict in (Verdict.BETTER, Verdict.WORSE, Verdict.UNDECIDED)) > 50


def test_comparisons_of_different_sizes_keep_their_places(rng):
    """With 12 seeds or 7, with lost runs, with a seed of which nothing is said, or with none: each by itself."""
    pairs = [(scatter(rng, 0.2, n), scatter(rng, 0.2, n)) for n in (12, 7, 12, 0, 7, 12)]
    pairs[2][0][:2] = np.inf
    pairs[4][1][3] = np.nan
    judgements = judged([log_ratios(*pair) for pair in pairs])

    assert [judgement.n for judgement in judgements] == [12, 7, 12, 0, 6, 12]
    assert [judgement.failures for judgement in judgements] == [(0, 0), (0, 0), (2, 0), (0, 0), (0, 0), (0, 0)]
    assert judgements[2].ratio == pytest.approx(np.median(pairs[2][0] / pairs[2][1]), rel=0.01)
    assert math.isnan(judgements[3].ratio)
    for place in (0, 1, 4, 5):
        d = np.log(pairs[place][0] / pairs[place][1])
        d = d[~np.isnan(d)]
        judgement = judgements[place]
        ends = d.mean() + judgement.critical * sem(d) * np.array([-1, 1])
        assert (judgement.low, judgement.high) == pytest.approx(tuple(np.exp(ends)))


def test_twelve_lost_of_twenty_runs_are_never_better_and_a_lost_run_is_the_worst_rank(rng):
    base = scatter(rng, 0.3)
    risky = 0.9 * base * scatter(rng, 0.01)
    risky[:12] = np.inf
    found = judge(risky, base)
    assert found.verdict is Verdict.MORE_FAILED
    assert found.ratio == math.inf  # the median run is lost
    assert found.p_failed == pytest.approx(2 * binomtest(12, 12).pvalue)  # one of two tests
    assert judge(base, risky).verdict is Verdict.FEWER_FAILED
    a = 0.9 * base * scatter(rng, 0.01)
    b = base.copy()
    b[4] = np.inf
    found = judge(a, b)
    assert found.verdict is Verdict.BETTER
    assert found.p == pytest.approx(2 * binomtest(20, 20).pvalue)


@pytest.mark.parametrize("lost", range(1, 12))
def test_who_loses_more_runs_is_not_better(rng, lost):
    base = scatter(rng, 0.3)
    risky = 0.5 * base * scatter(rng, 0.01)
    risky[:lost] = np.inf
    assert judge(risky, base).verdict in {Verdict.UNDECIDED, Verdict.MORE_FAILED}


@pytest.mark.parametrize(("seeds", "verdict"), [(20, Verdict.UNDECIDED), (400, Verdict.EQUAL)])
def test_runs_lost_by_both_leave_the_others_equal_where_they_are_few(rng, seeds, verdict):
    base = scatter(rng, 0.3, seeds)
    base[:3] = np.inf
    with np.errstate(invalid="ignore"):
        found = judge(base * np.where(np.arange(seeds) % 2, 1.002, 0.998), base)
    assert found.verdict is verdict
    assert (found.failed, found.outlying) == ((3, 3), (0, 0))
    assert found.failure_rates == {20: "3 of 20 failed (up to 34 %)", 400: "3 of 400 failed (up to 1.9 %)"}[seeds]


@pytest.mark.parametrize(("seeds", "verdict"), [(20, Verdict.UNDECIDED), (98, Verdict.UNDECIDED), (99, Verdict.EQUAL)])
def test_equal_within_3_percent_needs_99_seeds_without_a_loss(rng, seeds, verdict):
    base = scatter(rng, 0.3, seeds)
    found = judge(base * scatter(rng, 0.005, seeds), base)
    assert found.verdict is verdict
    assert found.reason == ("" if verdict is Verdict.EQUAL else "more seeds are needed to exclude rare failures")


def test_losses_are_told_with_their_bounds_and_smaller_errors_in_spite_of_more_are_undecided(rng):
    base = scatter(rng, 0.3)
    a = base * scatter(rng, 0.1)
    a[:3] = np.inf
    assert judge(a, base).failure_rates == "3 of 20 failed (up to 34 %) against 0 of 20 failed (up to 14 %)"
    assert judge(base, a).failure_rates == judge(a, base).swapped.failure_rates
    assert judge(base, base).failure_rates == "0 of 20 failed (up to 14 %)"
    a = 0.5 * base * scatter(rng, 0.01)
    a[0] = np.inf
    found = judge(a, base)
    assert (found.verdict, found.high < 1) == (Verdict.UNDECIDED, True)
    assert found.reason == "the method with the smaller errors failed in more runs"


def test_a_lock_out_is_no_scatter_and_a_method_that_is_always_wrong_has_none(rng):
    """Of one run that is fifty times as wrong the mean says nothing; the median does, by the exact sign test."""
    base = scatter(rng, 0.3)
    a = 0.8 * base * scatter(rng, 0.01)
    b = base.copy()
    b[0] *= 50
    found = judge(a, b)
    assert found.median
    assert (found.failed, found.outlying) == ((0, 0), (0, 1))
    other = "1 of 20 with over 10 times the error (up to 22 %)"
    assert found.failure_rates == f"0 of 20 failed (up to 14 %) against {other}"
    assert found.verdict is Verdict.BETTER
    assert found.ratio == pytest.approx(0.8, rel=0.02)
    found = judge(50 * base * scatter(rng, 0.1), base)
    assert (found.verdict, found.median, found.outlying) == (Verdict.WORSE, False, (0, 0))
    scattered = judge(50 * base * scatter(rng, 1.5), base)
    assert (scattered.verdict, scattered.median) == (Verdict.WORSE, True)


@pytest.mark.parametrize("share", [0.2, 0.6, 0.9])
@pytest.mark.parametrize("factor", [12, 1000])
@pytest.mark.parametrize("seeds", [10, 20, 50])
def test_a_method_that_is_ruined_in_a_share_of_the_runs_does_not_win(rng, seeds, factor, share):
    """In these runs b is many times as wrong, else the two are equal."""
    a = scatter(rng, 0.1, (60, seeds))
    b = scatter(rng, 0.1, (60, seeds)) * np.where(rng.random((60, seeds)) < share, factor, 1)
    found = [judge(*pair) for pair in zip(a, b, strict=True)]
    assert sum(one.verdict in DEFEATS for one in found) <= 1
    assert not any(one.reason for one in found)
    if seeds >= 20 and share >= 0.6:
        assert sum(one.verdict in WINS for one in found) >= 54


def test_an_interval_that_says_nothing_is_not_given(rng):
    """Seven seeds in a study of 400 comparisons, some of which have hardly any scatter but for one seed."""
    d = np.where(np.arange(7) == 0, 3.0, 1e-9 * rng.standard_normal((400, 7)))
    for found in judged([log_ratios(np.exp(row), np.ones(7)) for row in d]):
        assert found.verdict is Verdict.UNDECIDED
        assert math.isnan(found.low) or found.high / found.low < 1e6


@pytest.mark.parametrize(("seeds", "verdict"), [(100, Verdict.UNDECIDED), (800, Verdict.EQUAL)])
def test_one_failure_more_is_equal_where_its_share_is_surely_below_the_margin(rng, seeds, verdict):
    """Of 100 runs one failure leaves it open, of 800 it does not."""
    base = scatter(rng, 0.3, seeds)
    a = base * np.where(np.arange(seeds) % 2, 1.002, 0.998)
    a[7] *= 50
    found = judge(a, base)
    assert found.failures == (1, 0)
    assert (binomtest(1, seeds, 0.03, "less").pvalue < 0.05) == (verdict is Verdict.EQUAL)
    assert found.verdict is verdict


def test_the_same_is_equal_the_margin_decides_and_p_grows_with_the_study(rng):
    base = scatter(rng, 0.3, 99)
    assert judge(base, base.copy()).verdict is Verdict.EQUAL
    assert judge(base[:2], base[:2].copy()).verdict is Verdict.UNDECIDED
    found = judge([np.nan], [1.0])
    assert (found.n, found.verdict) == (0, Verdict.UNDECIDED)
    assert math.isnan(found.ratio)
    base = scatter(rng, 0.3, 29)
    a = 1.05 * base * scatter(rng, 0.01, 29)
    assert judge(a, base).verdict is Verdict.WORSE
    assert judge(a, base, margin=0.1).verdict is Verdict.SMALL
    one = log_ratios(scatter(rng, 0.1) * 0.93, scatter(rng, 0.1))
    others = [log_ratios(scatter(rng, 0.1), scatter(rng, 0.1)) for _ in range(60)]
    assert judged([one, *others])[0].p > judged([one])[0].p


def test_the_largest_t_of_one_comparison_is_the_studentised_bootstraps_and_its_tail_a_pareto(rng):
    """Against scipy's own resamples of the studentised mean: the 95 % points agree to the scatter of 5000 draws."""
    x = rng.standard_normal(15)
    drawn = rng.choice(x - x.mean(), (5000, 15))
    t = np.abs(ttest_1samp(drawn, 0, axis=1).statistic)
    assert max_t(x[None]).critical(0.05) == pytest.approx(np.quantile(t, 0.95), rel=0.06)
    drawn = np.random.default_rng(_SEED).multinomial(15, np.full(15, 1 / 15), _RESAMPLES)
    values = [np.repeat(x - x.mean(), counts) for counts in drawn]
    t = np.sort([abs(ttest_1samp(value, 0).statistic) for value in values])[::-1]
    shape, _, _ = pareto.fit(t[:100], floc=0, fscale=t[100])
    quantile, slope, _ = max_t(x[None]).scales
    assert quantile[0] == pytest.approx(t[100])
    assert slope[0] == pytest.approx(1 / shape, rel=1e-3)
    family = max_t(rng.standard_normal((7, 12)))
    c = family.critical(0.05)
    assert (family.p(c * (1 + 1e-9)) <= 0.05).all()
    assert (family.p(c * (1 - 1e-9)) > 0.05).all()
    np.testing.assert_allclose(family.p(np.full(7, 1e9)), 1 / 2000)
    assert np.isinf(family.critical(5e-5)).all()


def test_one_comparison_with_a_seed_apart_does_not_set_the_bar_for_the_others(rng):
    """A seed twenty standard deviations out is missing in a third of the resamples, whose t is then enormous."""
    d = 0.05 * rng.standard_normal((60, 20)) + 0.08 * (np.arange(60) < 30)[:, None]
    apart = 0.05 * rng.standard_normal(20)
    apart[0] += 1.0
    alone, together = (
        judged([log_ratios(np.exp(row), np.ones(20)) for row in rows]) for rows in (d, np.vstack([d, apart]))
    )
    assert sum(judgement.verdict is Verdict.WORSE for judgement in alone) >= 29
    assert [judgement.verdict for judgement in together[:-1]] == [judgement.verdict for judgement in alone]
    assert together[-1].critical > 2 * max(judgement.critical for judgement in alone)


def test_four_times_at_a_spread_of_5_percent_is_decided_in_the_family_of_a_whole_study(rng):
    """1200 comparisons: one in ten has a ratio of 4, the others differ by chance, some with heavy tails."""
    d = np.vstack([0.05 * rng.standard_normal((1000, 20)), 0.05 * rng.standard_t(3, (200, 20))])
    d[::10] += np.log(4)
    judgements = judged([log_ratios(np.exp(row), np.ones(20)) for row in d])
    assert {judgement.verdict for judgement in judgements[::10]} == {Verdict.WORSE}


@pytest.mark.parametrize("seeds", [2, 3, 4, 5])
def test_of_fewer_than_six_seeds_nothing_is_decided(rng, seeds):
    base = scatter(rng, 0.3, seeds)
    same, better, lost = base * scatter(rng, 1e-4, seeds), base / 25 * scatter(rng, 1e-4, seeds), base.copy()
    lost[:] = np.inf
    judgements = judged([log_ratios(case, base) for case in (same, better, lost, base)])
    assert {judgement.verdict for judgement in judgements} == {Verdict.UNDECIDED}


@pytest.mark.parametrize("name", ["skewed", "t3", "normal"])
def test_few_studies_of_equal_methods_have_a_false_sentence(name):
    """400 studies of 10 comparisons over 20 seeds: 5 % have a standard error of 1.1 %."""
    rng = np.random.default_rng(15)
    draws = {
        "skewed": lambda: np.exp(0.5 * rng.standard_normal((10, 20))) - math.exp(0.125),
        "t3": lambda: rng.standard_t(3, (10, 20)),
        "normal": lambda: rng.standard_normal((10, 20)),
    }
    wrong = 0
    for _ in range(400):
        found = judged([log_ratios(np.exp(0.1 * row), np.ones(20)) for row in draws[name]()])
        wrong += any(one.verdict in {Verdict.BETTER, Verdict.WORSE} for one in found)
    assert wrong / 400 <= 0.072


def test_a_method_that_diverges_more_often_is_not_called_better_by_its_other_runs():
    """One ordinary run makes all runs of b outliers; they do not outweigh runs that diverged."""
    fewer = [math.inf] * 3 + [1 / 1.5] + [1 / 20] * 16
    more = [math.inf] * 4 + [2.0] + [1 / 11] * 15
    assert judge(fewer, np.ones(20)).verdict is Verdict.UNDECIDED
    assert judge(np.ones(20), fewer).verdict is Verdict.UNDECIDED
    assert judge(more, np.ones(20)).verdict is Verdict.UNDECIDED
    assert judge([math.inf] * 4 + [0.98] * 36, np.ones(40)).verdict is not Verdict.SMALL


@pytest.mark.parametrize("zeros", [11, 20])
def test_errors_of_zero_are_better(zeros):
    assert judge([0.0] * zeros + [0.5] * (20 - zeros), np.ones(20)).verdict is Verdict.BETTER
