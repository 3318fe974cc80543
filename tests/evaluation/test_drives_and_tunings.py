import numpy as np
import pytest
from scipy import optimize, stats

from commands import experiment
from jerkbench.errors import PluginError
from jerkbench.evaluation import drives_and_tunings
from jerkbench.evaluation.drives_and_tunings import (
    Losses,
    comparisons,
    crossed_intervals,
    intervals_from,
    log_losses,
    procedure_error,
    resampled,
    statements,
)
from jerkbench.evaluation.judgement import Verdict

mixture_weights = experiment("audit/audit_page.py").mixture_weights

M, P, R, D = 12, 4, 16, 60


def crossed(random, k, sigma_a, sigma_b, sigma_e, tunings=R, drives=D, skewed=True):
    """Draw (k, R, D) of crossed random effects without a mean."""
    a = random.standard_normal((k, tunings, 1)) * np.reshape(sigma_a, (-1, 1, 1))
    b = random.exponential(size=(k, 1, drives)) - 1.0 if skewed else random.standard_normal((k, 1, drives))
    return a + sigma_b * b + sigma_e * random.standard_normal((k, tunings, drives))


def drawn_losses(random, sigma_a=0.08):
    """An audit in which no method differs from any plain filter, and tuning tells nothing about judging."""
    drive, luck = random.standard_normal(D), random.uniform(0.3, 2.0, M) * sigma_a
    of = [drive + crossed(random, k, sd, 0.3, 0.2) for k, sd in ((M, luck), (P, 0.05), (P, 0.05))]
    tuned = [random.standard_normal((k, R)) for k in (M, P, P)]
    averaged = np.arange(M) < M // 2
    return Losses(*of, *tuned, np.arange(M) % P, averaged, ~averaged)


def hall_end(q, bend):
    """Where Hall's cubic is q, found by a search."""
    return optimize.brentq(lambda t: t + bend * t**2 / 3 + bend**2 * t**3 / 27 + bend / 6 - q, -50, 50)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_one_comparison_is_the_analysis_of_variance_of_two_crossed_factors(seed):
    y = crossed(np.random.default_rng(seed), 1, 0.2, 0.4, 0.3, 5, 9)[0]
    grand, rows, columns = y.mean(), y.mean(axis=1), y.mean(axis=0)
    ms_rows = 9 * sum((row - grand) ** 2 for row in rows) / 4
    ms_columns = 5 * sum((column - grand) ** 2 for column in columns) / 8
    ms_rest = sum((y[i, j] - rows[i] - columns[j] + grand) ** 2 for i in range(5) for j in range(9)) / 32
    variance = (ms_rows + ms_columns - ms_rest) / 45
    of_rows = (ms_rows - ms_rest) / 45
    dof = variance**2 / (of_rows**2 / 4 + (ms_columns / 45) ** 2 / 8)
    q, error = stats.t.ppf(0.975, dof), np.sqrt(variance)
    third = stats.kstat(rows, 3) / 5**2 + sum((column - grand) ** 3 for column in columns) / 9**3 * (9 / 8)
    bend = 0.6 * third / error**3
    low, high = (grand - hall_end(end, bend) * error for end in (q, -q))

    found = [float(part[0]) for part in crossed_intervals(y[None], 0.05)]
    expected = [grand, min(low, grand - q * error), max(high, grand + q * error), (ms_rows - ms_rest) / 9]
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_the_variance_of_the_tunings_is_the_larger_of_the_own_and_that_of_all():
    random = np.random.default_rng(2)
    y = np.concatenate([crossed(random, 9, 0.0, 0.3, 0.2), crossed(random, 3, 0.5, 0.3, 0.2)])
    own = np.array([crossed_intervals(each[None], 0.05)[3][0] for each in y])

    assert (own[:9] < 0.0).any()  # is not cut to zero
    np.testing.assert_allclose(crossed_intervals(y, 0.05)[3], np.maximum(own, own.mean()))


def test_the_variance_is_unbiased_with_weights_too():
    random, weights = np.random.default_rng(3), mixture_weights(np.arange(D) < 10, 0.6)
    S2 = (weights**2).sum()
    y = crossed(random, 4000, 0.1, 0.4, 0.5, skewed=False)
    known = 0.4**2 * S2 + 0.1**2 / R + 0.5**2 * S2 / R
    each = [crossed_intervals(one[None], 0.3, weights) for one in y]
    mean, low, high, tuning = np.array(each)[:, :, 0].T

    np.testing.assert_allclose(mean.var(), known, rtol=0.08)
    np.testing.assert_allclose(tuning.mean(), 0.1**2, rtol=0.05)
    assert abs(((low < 0) & (high > 0)).mean() - 0.7) < 0.03


def test_comparators_are_the_own_plain_filter_and_the_best_of_each_tuning_and_share_the_error():
    losses = drawn_losses(np.random.default_rng(5))
    average, pick, own, best = comparisons(losses)
    for r in range(R):
        plain = int(np.argsort(losses.tuned_plains[:, r])[0])
        wide = int(np.argsort(losses.tuned_wide[:, r])[0])
        chosen = M // 2 + int(np.argsort(losses.tuned[M // 2 :, r])[0])
        np.testing.assert_array_equal(own[5, r], losses.methods[5, r] - losses.plains[1, r])
        np.testing.assert_array_equal(best[:, r], losses.methods[:, r] - losses.plains[plain, r])
        np.testing.assert_array_equal(pick[0, r], losses.methods[chosen, r] - losses.wide[wide, r])
    np.testing.assert_allclose(average[0], sum(own[m] for m in range(M // 2)) / (M // 2))
    losses = drawn_losses(np.random.default_rng(9))
    said, level = statements(losses), 0.05 / 3
    ways = [said.average, said.pick, said.same_model_plain[3], said.best_plain[3]]
    levels = [level, level, level / (2 * M), level / (2 * M)]
    for one, y, alone in zip(ways, comparisons(losses), levels, strict=True):
        _, low, high, _ = crossed_intervals(y, alone)
        place = 3 if len(y) > 1 else 0
        np.testing.assert_allclose([one.low, one.high], np.exp([low[place], high[place]]))


def test_where_nothing_differs_few_audits_say_that_something_does():
    random, wrong, naive = np.random.default_rng(6), 0, 0
    for _ in range(300):
        losses = drawn_losses(random, 0.25)
        said = statements(losses)
        each = [said.average, said.pick, *said.same_model_plain, *said.best_plain]
        wrong += any(one.verdict in (Verdict.BETTER, Verdict.WORSE) for one in each)
        over_drives = comparisons(losses)[3].mean(axis=1)
        naive += bool((stats.ttest_1samp(over_drives, 0.0, axis=1).pvalue < 0.05 / 3 / (2 * M)).any())

    assert stats.binomtest(wrong, 300, 0.05, alternative="greater").pvalue > 0.01
    assert naive > 60  # as if one tuning were all there is


def test_verdicts_of_known_ratios():
    losses, shift = drawn_losses(np.random.default_rng(7)), np.zeros((M, 1, 1))
    near = losses.plains[losses.model] + 0.01 * crossed(np.random.default_rng(8), M, 0.1, 0.3, 0.2)
    shift[:5, 0, 0] = np.log([0.5, 0.96, 1.0, 1.04, 1.5])
    said = statements(losses._replace(methods=near + shift)).same_model_plain[:5]

    assert [one.verdict for one in said] == ["better", "better", "equal", "worse", "worse"]
    assert [one.small for one in said] == [False, True, True, True, False]
    assert str(said[1]).endswith("better, by less than 10%")
    assert str(said[2]).endswith("] equal")
    for one, ratio in zip(said, (0.5, 0.96, 1.0, 1.04, 1.5), strict=True):
        assert one.low < ratio < one.high


def test_an_audit_that_is_drawn_is_that_of_the_rows_that_were_drawn():
    """The rows are copied here, as often as each was drawn."""
    y = 0.1 + crossed(np.random.default_rng(12), 5, 0.1, 0.3, 0.2)
    random, audits = np.random.default_rng(13), 0
    for drawn in resampled(y, 40, np.random.default_rng(13)):
        r, d = random.integers(R, size=R), random.integers(D, size=D)
        audits += 1
        np.testing.assert_allclose(intervals_from(*drawn, 0.01), crossed_intervals(y[:, r][:, :, d], 0.01), rtol=1e-9)
    assert audits == 40


def test_another_mixture_weighs_the_drives_that_there_are():
    faulty = np.arange(D) >= 20
    weights = mixture_weights(faulty, 0.05)
    y = crossed(np.random.default_rng(10), 2, 0.1, 0.3, 0.2)

    np.testing.assert_allclose([weights.sum(), weights[faulty].sum()], [1.0, 0.05])
    mean = crossed_intervals(y, 0.05, weights)[0]
    np.testing.assert_allclose(mean, 0.05 * y[..., faulty].mean(axis=(1, 2)) + 0.95 * y[..., ~faulty].mean(axis=(1, 2)))
    same = crossed_intervals(y, 0.05, mixture_weights(faulty, 40 / 60))
    np.testing.assert_allclose(same, crossed_intervals(y, 0.05))


@pytest.mark.parametrize(("member", "share"), [([False] * 3, 0.1), ([True] * 3, 0.9), ([True, False], 1.2)])
def test_what_was_never_drawn_cannot_be_added(member, share):
    with pytest.raises(PluginError, match="so its share cannot be"):
        mixture_weights(np.array(member), share)


def test_a_lost_run_costs_a_multiple_and_a_method_that_is_its_plain_filter_decides_nothing():
    losses = log_losses(np.array([0.2, np.nan]), np.array([False, True]), np.array([0.1, 0.3]), 10.0)
    np.testing.assert_allclose(np.exp(losses), [0.2, 3.0])
    assert np.isnan(crossed_intervals(np.zeros((1, R, D)), 0.05)[1]).all()


def test_the_error_of_the_whole_procedure_is_told_from_its_rows(monkeypatch):
    losses = drawn_losses(np.random.default_rng(11))
    losses = losses._replace(methods=losses.methods - 0.4)  # a true difference is no error
    error = procedure_error(losses, 200)

    assert error.audits == 200
    assert error.low <= 0.05
    assert error == procedure_error(losses, 200)
    assert error.low == pytest.approx(stats.beta.ppf(0.05, error.wrong, 201 - error.wrong) if error.wrong else 0.0)
    monkeypatch.setattr(drives_and_tunings, "FAMILIES", 0.05)  # a level that is 60 times too large
    assert procedure_error(losses, 200).low > 0.05
