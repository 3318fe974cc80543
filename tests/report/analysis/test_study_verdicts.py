"""One family of a study: whoever asks, in whatever order, is told the same."""

import itertools

import numpy as np
import pandas as pd
import pytest

from jerkbench.evaluation.judgement import SWAPPED
from jerkbench.report.findings import findings, study_verdicts
from jerkbench.report.summary import summarise
from made_rows import cell_rows

METRIC = "position_rmse_m"


@pytest.fixture(scope="module")
def rows():
    """Three scenarios, two filters with three adaptations (one is the oracle), and the floor; eight seeds."""
    rng = np.random.default_rng(7)
    methods = [*itertools.product(("jerk", "baseline"), ("none", "mtf", "oracle")), ("gnss_only", "none")]
    made = []
    for scenario, (k, method) in itertools.product(("none", "bias", "outage"), enumerate(methods)):
        made += cell_rows(*method, np.exp(0.05 * k + 0.06 * rng.standard_normal(8)), disturbance=scenario)
    return pd.DataFrame(made)


@pytest.fixture(scope="module")
def verdicts(rows):
    return study_verdicts(rows, METRIC)


def test_the_family_is_every_two_rivals_and_each_reference_with_what_differs_in_one_factor(verdicts):
    rivals = 3 * 6  # four methods, three scenarios
    oracles = 3 * (2 * 2 + 1)  # with both adaptations of its filter, and with each other
    floors = 3 * 2  # with the two filters that have no adaptation
    assert len(verdicts.judged) == rivals + oracles + floors
    assert {comparison.family for comparison in verdicts.judged.values()} == {rivals + oracles + floors}


@pytest.mark.parametrize("baseline", [{"adaptation": "none"}, {"filter": "baseline"}, {"adaptation": "mtf"}])
def test_a_table_is_marked_by_the_same_judgement_as_the_page_from_either_side(rows, verdicts, baseline):
    table = summarise(rows, METRIC, baseline=baseline, verdicts=verdicts)
    marks = {
        (row, column): cell.ratio.mark
        for row, line in zip(table.rows, table.cells, strict=True)
        for column, cell in zip(table.columns, line, strict=True)
        if cell is not None and cell.ratio is not None
    }
    compared = verdicts.against(baseline)
    assert len(marks) == len(compared)
    for comparison in compared:
        other = verdicts.judged.get((comparison.baseline, comparison.subject))
        if other is not None:
            assert comparison.verdict is SWAPPED.get(other.verdict, other.verdict)
            assert comparison.judgement.ratio == pytest.approx(1 / other.judgement.ratio)
            assert (comparison.judgement.low, comparison.judgement.p) == pytest.approx(
                (1 / other.judgement.high, other.judgement.p)
            )
        place = (comparison.subject[1], comparison.subject[3]), (comparison.subject[4],)
        assert marks[place] == comparison.mark


def test_a_turned_comparison_is_what_judging_the_other_way_round_gives(rows, verdicts):
    """The bootstrap's t changes its sign with d, and nothing else."""
    swapped = study_verdicts(rows.iloc[::-1], METRIC)
    for pair, comparison in verdicts.judged.items():
        (other,) = swapped.compare([pair])
        assert other.verdict is comparison.verdict
        assert other.judgement.p == pytest.approx(comparison.judgement.p)
        assert other.judgement.low == pytest.approx(comparison.judgement.low)


def test_what_no_scenario_holds_together_is_a_family_of_its_own(verdicts):
    across = verdicts.against({"disturbance": "none"})
    assert {comparison.family for comparison in across} == {14}


def test_where_the_attitude_alone_varies_it_is_the_method(rows):
    tilts = rows[(rows["filter"] == "jerk") & (rows["adaptation"] == "none")]
    both = pd.concat([tilts, tilts.assign(attitude="reference"), tilts.assign(attitude="gyro_only")])
    verdicts = study_verdicts(both, METRIC)
    assert len(verdicts.standings) == 3
    assert {rival[2] for standing in verdicts.standings for rival in standing.rivals} == {"tilt", "gyro_only"}


def test_sentences_are_of_the_baseline_that_was_asked_for(rows, verdicts):
    """Three scenarios of two filters with two other adaptations; the floor has no partner."""
    told = findings(rows, verdicts, {"adaptation": "mtf"})
    assert len(told) == 3 * 2 * 2
    assert all("jerk+mtf" in line or "baseline+mtf" in line for line in told)
    assert findings(rows, verdicts) != told
