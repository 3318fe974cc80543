"""Two sets of results: what is the same, what is better, what fails a build."""

import numpy as np
import pandas as pd
import pytest

from jerkbench.errors import JerkbenchError
from jerkbench.report.changes import change_rows, changes, notes_of_tests
from jerkbench.report.comparisons import VerdictRule

SEEDS = 20
METRIC = "position_rmse_m"


def base():
    return np.exp(np.random.default_rng(1).normal(scale=0.5, size=SEEDS))


@pytest.fixture
def before(cell_rows):
    return pd.DataFrame([*cell_rows("jerk", "none", list(base())), *cell_rows("jerk", "mtf", list(base() / 2))])


def scaled(rows, factor, scatter=0.0):
    noise = np.exp(scatter * np.random.default_rng(2).normal(size=len(rows)))
    return rows.assign(position_rmse_m=rows[METRIC] * factor * noise)


def test_the_same_is_the_same_to_the_bit_and_a_rise_from_nothing_is_worse(before):
    found = changes(before, before.copy(), METRIC)
    assert [one.verdict for one in found] == ["identical"] * 2
    assert not any(one.failures(0.0) for one in found)
    none = before.assign(position_rmse_m=before[METRIC].where(before["seed"] != 3, 0.0))
    for one in changes(none, before, METRIC):
        assert one.failures(50.0) == ["1 of 20 runs increased from 0 (seed 3)"]
    assert not any(one.failures(50.0) or one.unjudged for one in changes(before, none, METRIC))


@pytest.mark.parametrize(("factor", "verdict", "fails"), [(1.1, "worse", True), (0.9, "better", False)])
def test_a_small_change_is_seen_on_the_same_seeds(before, factor, verdict, fails):
    for one in changes(before, scaled(before, factor, 0.02), METRIC):
        assert one.verdict == verdict
        assert one.judgement.ratio == pytest.approx(factor, rel=0.02)
        assert bool(one.failures(5.0)) is fails
        assert not one.failures(12.0)


@pytest.mark.parametrize("count", [10, 20])
@pytest.mark.parametrize("ruined", range(1, 11))
def test_the_gate_fails_for_every_number_of_ruined_runs(cell_rows, count, ruined):
    """1 to 10 runs of 10, and of 20, become 50 times as wrong; the others do not change."""
    rng = np.random.default_rng([count, ruined])
    errors = np.exp(rng.normal(scale=0.5, size=count))
    factors = np.where(rng.permutation(count) < ruined, 50.0, 1.0)
    sets = [pd.DataFrame(cell_rows("jerk", "none", list(values))) for values in (errors, errors * factors)]

    (one,) = changes(*sets, METRIC)
    mean, single = one.failures(3.0)
    assert f"{100 * (50.0 ** (ruined / count) - 1):.3g} % larger" in mean
    assert f"{ruined} of {count} runs" in single
    assert f"(seed{'s' * (ruined > 1)} {factors.argmax()}" in single
    assert one.failures(1e6) == [single]  # no tolerance allows a ruined run


@pytest.mark.parametrize("count", [10, 20])
@pytest.mark.parametrize("seed", range(10))
def test_the_gate_passes_an_unchanged_version(cell_rows, count, seed):
    """It may have diverged runs and runs without a value, and another processor rounds differently."""
    rng = np.random.default_rng([count, seed])
    errors = np.where(rng.random(count) < 0.1, np.nan, np.exp(rng.normal(scale=1.5, size=count)))
    status = np.where(rng.random(count) < 0.2, "diverged", "ok")
    rounded = errors * (1 + 1e-9 * rng.normal(size=count))
    sets = [pd.DataFrame(cell_rows("jerk", "none", list(of))).assign(status=status) for of in (errors, errors, rounded)]

    for later in sets[1:]:
        (one,) = changes(sets[0], later, METRIC)
        assert (one.failures(3.0), one.unjudged) == ([], "")


@pytest.mark.parametrize(("factor", "fails"), [(9.9, False), (10.1, True)])
def test_a_single_run_may_not_be_ten_times_as_wrong_even_where_the_mean_improves(before, factor, fails):
    factors = np.where(before["seed"] == 7, factor, 0.5)
    for one in changes(before, before.assign(position_rmse_m=before[METRIC] * factors), METRIC):
        found = one.failures(3.0)
        assert len(found) == fails
        assert all("seed 7" in sentence and "10.1 times" in sentence for sentence in found)


def test_without_a_common_seed_both_values_are_printed_and_there_is_no_verdict(before):
    later = scaled(before, 10.0, 0.02).assign(seed=lambda rows: rows["seed"] + 100)
    changed = changes(before, later, METRIC)
    for one, row in zip(changed, change_rows(changed, ["adaptation"]), strict=True):
        assert (one.verdict, one.failures(5.0)) == ("no verdict (no common seed)", [])
        assert one.unjudged == "A and B have no seed in common"
        assert row[3:] == ["", "", "", "no verdict (no common seed)"]
    assert notes_of_tests(changed) == [
        "Without a verdict, because A and B have no common seed (2): use the same first_seed and seeds."
    ]


@pytest.mark.parametrize(
    ("column", "at_seed_3", "reason"),
    [
        ("status", "diverged", "1 of 20 runs diverged or failed in B, 0 in A (seed 3)"),
        (METRIC, np.nan, "19 of 20 runs have a value in B, 20 in A (seed 3)"),
    ],
)
def test_more_lost_runs_and_fewer_values_are_worse(before, column, at_seed_3, reason):
    later = before.assign(**{column: before[column].mask(before["seed"] == 3, at_seed_3)})
    for one in changes(before, later, METRIC):
        assert one.failed == (0, int(column == "status"))
        assert one.failures(50.0) == [reason]
    assert not any(one.failures(50.0) for one in changes(later, before, METRIC))


def test_only_what_both_have_is_compared(before):
    found = changes(before, before[before["adaptation"] == "mtf"], METRIC)
    assert [one.first.combination[4] for one in found] == ["mtf"]
    alone = before[before["adaptation"] == "none"]
    (one,) = changes(alone, alone.assign(filter="other"), METRIC)  # a single one each: these two
    assert one.same
    with pytest.raises(JerkbenchError, match="have no combination in common"):
        changes(before, before.assign(filter="other"), METRIC)
    with pytest.raises(JerkbenchError, match="lower is not better"):
        changes(before.assign(anees=1.0), before.assign(anees=1.0), "anees")


def test_a_line_has_both_means_and_what_the_second_lacks_is_not_judged(before):
    later = scaled(before, 2.0)
    later.loc[later["seed"] == 0, "status"] = "diverged"
    first, _ = change_rows(changes(before, later, METRIC), ["filter", "adaptation"])
    assert first[:2] == ["jerk", "none"]
    assert first[3].endswith("(1/20 failed)")
    assert first[4] == "×2.00"  # noqa: RUF001
    fewer = before[(before["adaptation"] == "none") | (before["seed"] < 4)]
    none, mtf = changes(before, fewer, METRIC)
    assert (none.unjudged, none.absent, mtf.unjudged, mtf.absent) == ("", 0, "runs of A are missing in B", 16)
    halves = [before.assign(status=np.where((before["seed"] % 2 == k), "ok", "diverged")) for k in (0, 1)]
    assert all(one.unjudged and not one.same for one in changes(*halves, METRIC))  # as many lost, but never a pair


def test_who_loses_more_runs_is_not_better_and_what_is_within_three_percent_equal(before):
    """The survivors of twelve lost runs of twenty are a tenth better."""
    risky = scaled(before, 0.9, 0.02)
    risky.loc[risky["seed"] < 12, "status"] = "diverged"
    assert {one.verdict for one in changes(before, risky, METRIC)} == {"fails in more runs"}
    near = changes(before, scaled(before, 1.0, 0.01), METRIC)
    assert {(one.verdict, one.failure_rates) for one in near} == {
        ("undecided, because more seeds are needed to exclude rare failures", "0 of 20 failed (up to 14 %)")
    }
    equal = changes(before, scaled(before, 1.0, 0.01), METRIC, VerdictRule(0.15))
    assert {one.verdict for one in equal} == {"equal within 15 %"}


@pytest.mark.parametrize("column", ["status", METRIC])
def test_a_run_that_is_newly_lost_fails_although_another_one_recovers(before, column):
    worse = "diverged" if column == "status" else np.nan
    first, second = (before.assign(**{column: before[column].mask(before["seed"] == seed, worse)}) for seed in (1, 2))
    for one in changes(first, second, METRIC):
        (sentence,) = one.failures(5.0)
        assert "(seed 2)" in sentence


def test_one_run_that_improves_does_not_hide_the_others(cell_rows):
    errors = [pd.DataFrame(cell_rows("jerk", "none", of)) for of in ([1e4] + [1.0] * 9, [1.0] + [2.5] * 9)]
    (one,) = changes(*errors, METRIC)

    assert f"{100 * (0.1**0.1 * 2.5**0.9 - 1):.3g} % larger" in one.failures(5.0)[0]
