"""Statements on all scenarios, and on the size of a fault."""

import itertools

import numpy as np
import pandas as pd
import pytest
from scipy.stats import t as student

from jerkbench.evaluation.ranks import over_scenarios
from jerkbench.report.plots.studies import curves_figure, swept_rows
from jerkbench.report.study_verdicts import across, common_runs, study_verdicts
from jerkbench.report.table_model import number
from made_rows import cell_rows

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


def severe_rows(sizes=(0.1, 1.0, 10.0), seeds=5):
    made = []
    for size in sizes:
        fault = f"bias+false_fix(offset_m={size:g}, length_s=5)"
        for adaptation, cost in (("none", size), ("chi2", 0.5 + 0.05 * size)):
            made += cell_rows("jerk", adaptation, [cost] * seeds, disturbance=fault)
    return pd.DataFrame(made)


def test_the_parameter_that_is_swept_is_the_size_of_three_or_more():
    swept = swept_rows(severe_rows(), "disturbance")
    assert sorted(set(swept["swept_value"])) == [0.1, 1.0, 10.0]
    assert set(swept["swept_name"]) == {"offset_m"}
    assert set(swept["swept_in"]) == {"field: bias+false_fix(offset_m=..., length_s=5)"}
    assert swept_rows(severe_rows(sizes=(0.1, 1.0)), "disturbance").empty
    assert swept_rows(severe_rows().assign(disturbance="none"), "disturbance").empty
    both = pd.concat([severe_rows(), severe_rows().assign(disturbance="none")], ignore_index=True)
    assert len(swept_rows(both, "disturbance")) == len(severe_rows())
    (axes,) = curves_figure(swept_rows(severe_rows(), "disturbance"), "position_rmse_m").axes
    (line,) = [one for one in axes.get_lines() if one.get_label() == "jerk + none"]
    np.testing.assert_allclose(line.get_xdata(), [0.1, 1.0, 10.0])
    np.testing.assert_allclose(line.get_ydata(), [0.1, 1.0, 10.0])
