"""The first screen: the answer, the picture of methods and scenarios, the settings."""

import numpy as np
import pandas as pd

from jerkbench.report.findings import answer
from jerkbench.report.page_content import matrix, settings
from jerkbench.report.study_verdicts import study_verdicts
from made_rows import study_rows


def standings(frame):
    return study_verdicts(frame, "position_rmse_m").standings


def test_where_nothing_is_shown_nobody_is_said_to_lead():
    seen = standings(study_rows(2, 12.0))
    assert answer(seen).title.startswith("None of 3 methods was shown to beat another")
    assert not any(cell.leads for _, cells in matrix(seen).lines for cell in cells)
    assert {cell.style for _, cells in matrix(seen).lines for cell in cells} == {"undecided", "reference"}


def test_the_picture_has_ratios_to_the_baseline_and_colours_what_was_shown():
    frame = study_rows(20, 30.0)
    seen = matrix(standings(frame))
    assert seen.reference == "baseline+none"
    assert seen.columns == ("none", "bias")
    assert [label for label, _ in seen.lines] == ["jerk+mtf", "jerk+none", "baseline+none"]
    best, _, reference = (cells for _, cells in seen.lines)
    logs = np.log(frame["position_rmse_m"]).groupby([frame["disturbance"], frame["adaptation"], frame["filter"]]).mean()
    for scenario, cell in zip(seen.columns, best, strict=True):
        ratio = np.exp(logs[scenario, "mtf", "jerk"] - logs[scenario, "none", "baseline"])
        assert abs(float(cell.text) / ratio - 1) < 0.01
        assert (cell.style, cell.leads) == ("better3", True)
        assert "times better" in cell.hint
    assert [(cell.text, cell.style) for cell in reference] == [("1", "reference")] * 2
    (_, _, where), *_ = seen.worst
    assert where in seen.columns


def test_a_method_that_loses_runs_is_marked_and_at_its_worst_there():
    frame = study_rows(20, 1.0)
    lost = (frame["adaptation"] == "mtf") & (frame["disturbance"] == "bias")
    frame.loc[lost, "status"] = "diverged"
    seen = matrix(standings(frame))
    (cell,) = (cells[1] for label, cells in seen.lines if label == "jerk+mtf")
    assert (cell.text, cell.style, cell.lost) == ("lost", "worse3", "20 of 20 failed")
    assert ("jerk+mtf", "lost", "bias") in seen.worst


def test_many_scenarios_stand_in_rows():
    frame = pd.concat([study_rows(6, 12.0).assign(attitude=f"tilt{k}") for k in range(5)])
    seen = matrix(standings(frame))
    assert seen.corner == "scenario"
    assert len(seen.lines) == 10
    assert len(seen.columns) == 3


def test_settings_have_every_value_that_a_method_ran_with():
    def cell(accel, disturbance):
        spec = {"filter": {"name": "jerk", "accel_mps2": accel}, "adaptation": {"name": "mtf", "window": 1}}
        labels = {"filter": "jerk", "adaptation": "mtf", "dataset": "field", "disturbance": disturbance}
        return {"spec": spec, "labels": labels}

    (one,) = settings([cell(0.2, "none"), cell(0.5, "none"), cell(0.2, "bias")])
    assert one == ("jerk + mtf", 2, "filter.accel_mps2 0.200 or 0.500, adaptation.window 1")
