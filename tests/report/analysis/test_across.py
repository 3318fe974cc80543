"""Statements on all scenarios."""

import itertools

import numpy as np
import pandas as pd
import pytest
from scipy.stats import t as student

from jerkbench.evaluation.drives_and_tunings import over_scenarios
from jerkbench.report.findings import across, common_runs, study_verdicts
from jerkbench.report.table_model import number

METRIC = "position_rmse_m"
LEVELS = {"best": 1.0, "middle": 1.3, "last": 3.0}


@pytest.fixture
def rows(cell_rows):
    rng, made = np.random.default_rng(11), []
    for scenario, name in itertools.product("abcde", LEVELS):
        errors = LEVELS[name] * np.exp(0.02 * rng.standard_normal(8))
        made += cell_rows(name, "none", errors, disturbance=scenario)
    return pd.DataFrame(made)


def test_places_and_ratios_are_told(rows):
    places, second, last = across(study_verdicts(rows, METRIC))
    assert "best 1 (1 to 1), middle 2 (2 to 2), last 3 (3 to 3)" in places
    assert second.startswith("best over middle: 0.7")
    assert last.startswith("best over last: 0.33")


def test_who_loses_runs_is_last_and_has_no_ratio(rows):
    rows.loc[(rows["filter"] == "best") & (rows["seed"] == 0), "status"] = "diverged"
    places, *ratios = across(study_verdicts(rows, METRIC))
    assert "middle 1" in places
    assert not any(sentence.startswith("best over") for sentence in ratios)


def test_the_interval_of_the_first_over_the_last_allows_for_their_selection(rows):
    """Its t is that of all three pairs at once, from the scatter between scenarios and seeds."""
    verdicts = study_verdicts(rows, METRIC)
    _, _, logs = common_runs(verdicts)
    model = over_scenarios(logs[:, :, 0] - logs[:, :, 2])
    half = np.log(model.high / model.ratio) * student.ppf(1 - 0.025 / 3, model.dof) / student.ppf(0.975, model.dof)
    (said,) = [line for line in across(verdicts) if line.startswith("best over last")]
    ends = (number(model.ratio * np.exp(sign * half)) for sign in (-1, 1))
    assert f"(95 % {' to '.join(ends)} for all 3 pairs together" in said


def test_four_scenarios_have_no_mixed_model_and_one_says_nothing(rows):
    four, five = (across(study_verdicts(frame, METRIC)) for frame in (rows[rows["disturbance"] != "e"], rows))
    assert not any(" over " in line.split(":")[0] and "times" in line for line in four)
    assert any("mixed model" in line for line in five)
    for frame in (rows[rows["disturbance"] == "a"], rows.assign(replicate="phase")):
        assert across(study_verdicts(frame, METRIC)) == []
