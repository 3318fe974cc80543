"""Sentences about all scenarios, against the statistics that they name and against scipy."""

import itertools

import numpy as np
import pandas as pd
import pytest
from scipy.stats import kendalltau

from jerkbench.report.analysis.across import across, common_field
from jerkbench.report.analysis.study_verdicts import study_verdicts

METRIC = "position_rmse_m"
LEVELS = {"best": 1.0, "middle": 1.3, "last": 3.0}


@pytest.fixture
def rows():
    rng = np.random.default_rng(11)
    fixed = {"dataset": "field", "attitude": "tilt", "noise": "own", "adaptation": "none", "replicate": "seed"}
    made = []
    for scenario, name in itertools.product(("a", "b", "c", "d"), LEVELS):
        for seed in range(8):
            error = LEVELS[name] * np.exp(0.02 * rng.standard_normal())
            head = {**fixed, "status": "ok", "reason": "", "disturbance": scenario, "filter": name, "seed": seed}
            made.append({**head, METRIC: error, "velocity_rmse_mps": 1 / error})
    return pd.DataFrame(made)


def test_places_ratios_ranks_and_agreement_are_told(rows):
    places, second, last, ranks, agreement = across(rows, study_verdicts(rows, METRIC), METRIC)
    assert "best 1 (1 to 1), middle 2 (2 to 2), last 3 (3 to 3)" in places
    assert second.startswith("best over middle: 0.7")
    assert last.startswith("best over last: 0.33")
    assert ranks.startswith(
        "Mean ranks differ from 1.7 on (Nemenyi, 5 %); not told apart from the first: best 1.0, mid"
    )
    expected = kendalltau([1, 2, 3], [3, 2, 1])
    assert f"Velocity RMSE (3-D) {expected.statistic:.2f} (p {expected.pvalue:.3f})" in agreement


def test_the_field_has_the_logarithms_in_order(rows):
    field = common_field(study_verdicts(rows.sample(frac=1.0, random_state=1).sort_values("filter"), METRIC))
    assert field.logs.shape == (4, 8, 3)
    of = rows[(rows["disturbance"] == field.scenarios[2]) & (rows["filter"] == field.methods[1])]
    np.testing.assert_allclose(field.logs[2, :, 1], np.log(of.sort_values("seed")[METRIC]))


def test_who_loses_runs_is_last_and_has_no_ratio(rows):
    rows.loc[(rows["filter"] == "best") & (rows["seed"] == 0), "status"] = "diverged"
    places, *ratios = across(rows, study_verdicts(rows, METRIC), METRIC)
    assert "middle 1" in places
    assert not any(sentence.startswith("best over") for sentence in ratios)


def test_one_scenario_says_nothing_over_scenarios(rows):
    alone = rows[rows["disturbance"] == "a"]
    assert across(alone, study_verdicts(alone, METRIC), METRIC) == []
    phases = rows.assign(replicate="phase")
    assert across(phases, study_verdicts(phases, METRIC), METRIC) == []
