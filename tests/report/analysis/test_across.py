"""Sentences about all scenarios, against the statistics that they name and against scipy."""

import itertools

import numpy as np
import pandas as pd
import pytest
from scipy.stats import kendalltau
from scipy.stats import t as student

from jerkbench.evaluation.ranks import mean_ranks, over_scenarios
from jerkbench.report.study_verdicts import across, common_field, study_verdicts
from jerkbench.report.sweeps import costs
from jerkbench.report.table_model import number

METRIC = "position_rmse_m"
LEVELS = {"best": 1.0, "middle": 1.3, "last": 3.0}


@pytest.fixture
def rows(cell_rows):
    rng, made = np.random.default_rng(11), []
    for scenario, name in itertools.product("abcde", LEVELS):
        errors = LEVELS[name] * np.exp(0.02 * rng.standard_normal(8))
        made += cell_rows(name, "none", errors, disturbance=scenario)
    return pd.DataFrame(made).assign(velocity_rmse_mps=lambda made: 1 / made[METRIC])


def test_places_ratios_ranks_and_agreement_are_told(rows):
    places, second, last, ranks, agreement = across(rows, study_verdicts(rows, METRIC), METRIC)
    assert "best 1 (1 to 1), middle 2 (2 to 2), last 3 (3 to 3)" in places
    assert second.startswith("best over middle: 0.7")
    assert last.startswith("best over last: 0.33")
    assert ranks.startswith(
        "Mean ranks differ from 1.5 on (Nemenyi, 5 %); not told apart from the first: best 1.0, mid"
    )
    expected = kendalltau([1, 2, 3], [3, 2, 1])
    assert f"Velocity RMSE (3-D) {expected.statistic:.2f} (p {expected.pvalue:.3f})" in agreement


def test_the_field_has_the_logarithms_in_order(rows):
    field = common_field(study_verdicts(rows.sample(frac=1.0, random_state=1).sort_values("filter"), METRIC))
    assert field.logs.shape == (5, 8, 3)
    of = rows[(rows["disturbance"] == field.scenarios[2]) & (rows["filter"] == field.methods[1])]
    np.testing.assert_allclose(field.logs[2, :, 1], np.log(of.sort_values("seed")[METRIC]))


def test_ranks_are_those_of_the_profiles_and_one_run_that_locks_out_decides_none(rows):
    rows.loc[(rows["filter"] == "best") & (rows["seed"] == 0), METRIC] *= 1000
    field = common_field(study_verdicts(rows, METRIC))
    found = costs(rows, METRIC)
    assert found.methods == list(field.methods)
    np.testing.assert_array_equal(field.ranks, mean_ranks(found.means))
    np.testing.assert_array_equal(field.ranks, [1, 2, 3])


def test_who_loses_runs_is_last_and_has_no_ratio(rows):
    rows.loc[(rows["filter"] == "best") & (rows["seed"] == 0), "status"] = "diverged"
    places, *ratios = across(rows, study_verdicts(rows, METRIC), METRIC)
    assert "middle 1" in places
    assert not any(sentence.startswith("best over") for sentence in ratios)


def test_the_interval_of_the_first_over_the_last_allows_for_their_selection(rows):
    """Its t is that of all three pairs at once, from the scatter between scenarios and seeds."""
    verdicts = study_verdicts(rows, METRIC)
    logs = common_field(verdicts).logs
    model = over_scenarios(logs[:, :, 0] - logs[:, :, 2])
    half = np.log(model.high / model.ratio) * student.ppf(1 - 0.025 / 3, model.dof) / student.ppf(0.975, model.dof)
    (said,) = [line for line in across(rows, verdicts, METRIC) if line.startswith("best over last")]
    ends = (number(model.ratio * np.exp(sign * half)) for sign in (-1, 1))
    assert f"(95 % {' to '.join(ends)} for all 3 pairs at once" in said


def test_four_scenarios_have_no_mixed_model(rows):
    four, five = (
        across(frame, study_verdicts(frame, METRIC), METRIC) for frame in (rows[rows["disturbance"] != "e"], rows)
    )
    assert not any(" over " in line.split(":")[0] and "times" in line for line in four)
    assert any("mixed model" in line for line in five)


def test_one_scenario_and_phases_say_nothing_over_scenarios(rows):
    for frame in (rows[rows["disturbance"] == "a"], rows.assign(replicate="phase")):
        assert across(frame, study_verdicts(frame, METRIC), METRIC) == []
