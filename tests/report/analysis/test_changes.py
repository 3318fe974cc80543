"""Two sets of results: what is the same, what is better, what fails a build."""

import math

import numpy as np
import pandas as pd
import pytest

from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.families import Correction
from jerkbench.report.changes import change_rows, changes, notes_of_tests, other_leaders
from jerkbench.report.comparisons import VerdictRule
from jerkbench.report.study_verdicts import study_verdicts

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


def test_the_same_is_the_same_to_the_bit(before):
    found = changes(before, before.copy(), METRIC)
    assert [one.verdict for one in found] == ["the same to the bit"] * 2
    assert not any(one.worse(0.0) for one in found)


@pytest.mark.parametrize(("factor", "verdict", "fails"), [(1.1, "worse", True), (0.9, "better", False)])
def test_a_small_change_is_seen_on_the_same_seeds(before, factor, verdict, fails):
    for one in changes(before, scaled(before, factor, 0.02), METRIC):
        assert one.verdict == verdict
        assert one.judgement.ratio == pytest.approx(factor, rel=0.02)
        assert one.worse(5.0) is fails
        assert not one.worse(12.0)


def test_on_other_seeds_little_can_be_shown(before):
    later = scaled(before, 1.1, 0.02).assign(seed=lambda rows: rows["seed"] + 100)
    for one in changes(before, later, METRIC):
        assert not one.paired
        assert one.verdict == "undecided (other seeds)"
        assert not one.worse(5.0)
    much = scaled(before, 10.0, 0.02).assign(seed=lambda rows: rows["seed"] + 100)
    assert all(one.worse(5.0) and one.verdict == "worse (other seeds)" for one in changes(before, much, METRIC))


def test_more_lost_runs_are_worse(before):
    later = before.copy()
    later.loc[later["seed"] == 3, "status"] = "diverged"
    assert all(one.worse(50.0) and one.lost == (0, 1) for one in changes(before, later, METRIC))
    assert not any(one.worse(50.0) for one in changes(later, before, METRIC))


def test_only_what_both_have_is_compared(before):
    found = changes(before, before[before["adaptation"] == "mtf"], METRIC)
    assert [one.combination[4] for one in found] == ["mtf"]
    alone = before[before["adaptation"] == "none"]
    (one,) = changes(alone, alone.assign(filter="other"), METRIC)  # a single one each: these two
    assert one.same
    with pytest.raises(JerkbenchError, match="No combination of the 2 of the first"):
        changes(before, before.assign(filter="other"), METRIC)
    with pytest.raises(JerkbenchError, match="neither the lowest nor the highest"):
        changes(before.assign(anees=1.0), before.assign(anees=1.0), "anees")


def test_a_line_has_both_means_and_the_ratio(before):
    later = scaled(before, 2.0)
    later.loc[later["seed"] == 0, "status"] = "diverged"
    first, _ = change_rows(changes(before, later, METRIC), ["filter", "adaptation"])
    assert first[:2] == ["jerk", "none"]
    assert first[3].endswith("(1/20 lost)")
    assert first[4] == "×2.00"  # noqa: RUF001


def test_what_the_second_lacks_is_not_judged(before):
    fewer = before[(before["adaptation"] == "none") | (before["seed"] < 4)]
    none, mtf = changes(before, fewer, METRIC)
    assert (none.unjudged, none.absent, mtf.unjudged, mtf.absent) == (False, 0, True, 16)
    halves = [before.assign(status=np.where((before["seed"] % 2 == k), "ok", "diverged")) for k in (0, 1)]
    assert all(one.unjudged and not one.same for one in changes(*halves, METRIC))  # as many lost, but never a pair


def test_a_value_that_is_gone_is_worse(before):
    later = before.assign(position_rmse_m=before[METRIC].where(before["seed"] != 3))
    assert all(one.worse(50.0) for one in changes(before, later, METRIC))
    assert not any(one.worse(50.0) for one in changes(later, before, METRIC))


def test_what_rises_from_nothing_is_worse_although_it_has_no_ratio(before):
    none = before.assign(position_rmse_m=before[METRIC].where(before["seed"] != 3, 0.0))
    assert all(one.worse(50.0) for one in changes(none, before, METRIC))
    assert not any(one.worse(50.0) or one.unjudged for one in changes(before, none, METRIC))


def test_two_single_runs_of_other_seeds_are_judged_by_their_ratio(before):
    one = before[before["seed"] == 0]
    later = scaled(one, 100.0).assign(seed=1)
    assert all(change.worse(5.0) and math.isnan(change.judgement.low) for change in changes(one, later, METRIC))


def test_who_loses_more_runs_is_not_better_on_the_same_seeds(before):
    """The survivors of twelve lost runs of twenty are a tenth better."""
    risky = scaled(before, 0.9, 0.02)
    risky.loc[risky["seed"] < 12, "status"] = "diverged"
    assert {one.verdict for one in changes(before, risky, METRIC)} == {"loses more runs"}


def test_what_is_within_three_percent_is_equal(before):
    near = changes(before, scaled(before, 1.005, 0.01), METRIC)
    assert {(one.verdict, one.losses) for one in near} == {
        ("undecided, as losses are not excluded", "0 of 20 lost (up to 14 %)")
    }
    equal = changes(before, scaled(before, 1.005, 0.01), METRIC, VerdictRule(0.15))
    assert {one.verdict for one in equal} == {"equal within 15 %"}


def test_the_margin_and_the_correction_are_those_that_were_asked_for(before):
    rule = VerdictRule(0.2, Correction.FDR)
    changed = changes(before, scaled(before, 1.1, 0.02), METRIC, rule)
    assert {change.verdict for change in changed} == {"equal within 20 %"}
    assert "Benjamini and Hochberg over 2" in notes_of_tests(changed)[0]


def test_the_test_of_each_kind_of_seeds_is_named(before):
    later = scaled(before, 1.1, 0.02)
    moved = later.assign(seed=later["seed"] + 100 * (later["adaptation"] == "mtf"))
    same, others = notes_of_tests(changes(before, moved, METRIC))
    assert same.startswith("On the same seeds")
    assert others.startswith("On other seeds")


def test_where_others_lead_in_the_second_it_is_said(before):
    later = before.assign(position_rmse_m=before[METRIC] * np.where(before["adaptation"] == "mtf", 8.0, 1.0))
    scattered = [scaled(rows, 1.0, 0.02) for rows in (before, later)]
    standings = [study_verdicts(rows, METRIC).standings for rows in scattered]
    assert other_leaders(*standings) == ["In the lead: mtf in A, none in B."]
    assert other_leaders(standings[0], standings[0]) == []
