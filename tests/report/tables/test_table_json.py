"""A table as JSON has the numbers of its rows, to the last digit."""

import json
import math

import numpy as np
import pytest

from jerkbench.report.comparisons import parse_baseline
from jerkbench.report.summary import summarise
from jerkbench.report.writers import table_json


def cell_of(content, **factors):
    (cell,) = (cell for cell in content["cells"] if factors.items() <= cell["combination"].items())
    return cell


def test_a_cell_has_all_its_factors_and_all_digits(rows):
    content = json.loads(table_json(summarise(rows, "position_rmse_m")))
    cell = cell_of(content, filter="jerk", adaptation="none")

    assert set(cell["combination"]) == {"dataset", "disturbance", "attitude", "filter", "adaptation", "noise"}
    values = rows[(rows["filter"] == "jerk") & (rows["adaptation"] == "none")]["position_rmse_m"]
    assert cell["geometric_mean"] == pytest.approx(math.exp(np.log(values).mean()), rel=1e-12)
    assert cell["mean"] == pytest.approx(np.median(values), rel=1e-12)
    assert (content["unit"], cell["runs"], cell["average"]) == ("m", 8, "median")
    assert len(content["cells"]) == 3  # what was not run is not there


def test_a_median_that_is_lost_and_a_number_that_is_not_there(rows):
    rows.loc[(rows["filter"] == "baseline") & (rows["seed"] > 1), "status"] = "diverged"
    rows.loc[(rows["filter"] == "jerk") & (rows["adaptation"] == "none"), "status"] = "diverged"
    text = table_json(summarise(rows, "position_rmse_m"))
    most, every = (cell_of(json.loads(text), adaptation="none", filter=name) for name in ("baseline", "jerk"))

    assert (most["diverged"], most["average"], most["mean"]) == (6, "median", "lost")
    assert (every["diverged"], every["mean"]) == (8, None)
    assert "NaN" not in text
    assert "Infinity" not in text


def test_ratios_to_a_baseline(rows):
    table = summarise(rows, "position_rmse_m", baseline=parse_baseline("adaptation=none"))
    content = json.loads(table_json(table))
    ratio = cell_of(content, filter="jerk", adaptation="sage_husa")["ratio"]
    jerk = rows[rows["filter"] == "jerk"].pivot_table(index="seed", columns="adaptation", values="position_rmse_m")

    assert content["baseline"] == {"adaptation": "none"}
    assert ratio["value"] == pytest.approx(math.exp(np.log(jerk["sage_husa"] / jerk["none"]).mean()), rel=1e-9)
    assert ratio["different"]
    assert cell_of(content, filter="jerk", adaptation="none")["ratio"] is None
