"""The first screen of a report: answer, matrix, settings and figures."""

import numpy as np
import pandas as pd

from jerkbench.report import page as room
from jerkbench.report.findings import answer, study_verdicts
from jerkbench.report.page import gallery, matrix, settings
from jerkbench.report.plots.studies import Picture
from made_rows import study_rows


def standings(frame):
    return study_verdicts(frame, "position_rmse_m").standings


def test_where_nothing_is_shown_nobody_is_said_to_lead():
    seen = standings(study_rows(2, 12.0))
    assert answer(seen).title.startswith("None of 3 methods is significantly better than another")
    cells = [cell for _, cells in matrix(seen)["lines"] for cell in cells]
    assert not any(cell["leads"] for cell in cells)
    assert {cell["style"] for cell in cells} == {"undecided", "reference"}


def test_the_picture_has_ratios_to_the_baseline_and_marks_lost_runs():
    frame = study_rows(20, 30.0)
    seen = matrix(standings(frame))
    assert seen["reference"] == "baseline+none"
    assert seen["columns"] == ["none", "bias"]
    assert [label for label, _ in seen["lines"]] == ["jerk+mtf", "jerk+none", "baseline+none"]
    best, _, reference = (cells for _, cells in seen["lines"])
    logs = np.log(frame["position_rmse_m"]).groupby([frame["disturbance"], frame["adaptation"], frame["filter"]]).mean()
    for scenario, cell in zip(seen["columns"], best, strict=True):
        ratio = np.exp(logs[scenario, "mtf", "jerk"] - logs[scenario, "none", "baseline"])
        assert abs(float(cell["text"]) / ratio - 1) < 0.01
        assert (cell["style"], cell["leads"]) == ("better", True)
    assert [(cell["text"], cell["style"]) for cell in reference] == [("1", "reference")] * 2
    frame = pd.concat([study_rows(6, 12.0).assign(attitude=f"tilt{k}") for k in range(5)])
    seen = matrix(standings(frame))
    assert len(seen["lines"]) == 3
    assert len(seen["columns"]) == 10
    frame = study_rows(20, 1.0)
    lost = (frame["adaptation"] == "mtf") & (frame["disturbance"] == "bias")
    frame.loc[lost, "status"] = "diverged"
    seen = matrix(standings(frame))
    (cell,) = (cells[1] for label, cells in seen["lines"] if label == "jerk+mtf")
    assert (cell["text"], cell["style"], cell["failed"]) == ("failed", "worse", "20 of 20 failed")


def test_a_small_significant_difference_is_not_marked_as_equal():
    frame = study_rows(20, 1.0)
    jerk = (frame["filter"] == "jerk") & (frame["adaptation"] == "none") & (frame["disturbance"] == "none")
    plain = (frame["filter"] == "baseline") & (frame["disturbance"] == "none")
    jitter = np.random.default_rng(0).normal(1.0, 1e-4, jerk.sum())
    frame.loc[jerk, "position_rmse_m"] = 1.02 * jitter * frame.loc[plain, "position_rmse_m"].to_numpy()
    (cells,) = (cells for label, cells in matrix(standings(frame))["lines"] if label == "jerk+none")

    assert cells[0]["text"] == "1.02~"


def test_settings_have_every_value_that_a_method_ran_with():
    def cell(accel, disturbance):
        spec = {"filter": {"name": "jerk", "accel_mps2": accel}, "adaptation": {"name": "mtf", "window": 1}}
        labels = {"filter": "jerk", "adaptation": "mtf", "dataset": "field", "disturbance": disturbance}
        return {"spec": spec, "labels": labels}

    (one,) = settings([cell(0.2, "none"), cell(0.5, "none"), cell(0.2, "bias")])
    assert one == ("jerk + mtf", "filter.accel_mps2 0.200 or 0.500, adaptation.window 1")


def picture(name, scenario):
    return Picture(name, name, scenario, "data:image/webp;base64,AAAA", 60, 60)


def test_scenarios_without_room_are_named_and_what_is_shown_otherwise_left_out(monkeypatch):
    pictures = [picture("bars", ""), *(picture(f"{name}-tilt", name) for name in ("a", "b", "c"))]
    assert gallery(pictures)["left_out"] == []
    one = len(pictures[0].data)
    monkeypatch.setattr(room, "MAX_FIGURE_CHARACTERS", int(3.5 * one))
    shown = gallery(pictures)
    assert [name for name, _ in shown["scenes"]] == ["a", "b"]
    assert shown["left_out"] == ["c"]
    pictures = [picture("a-errors", "a"), picture("a-tilt", "a")]
    assert [one.caption for one in gallery(pictures, ("errors",))["scenes"][0][1]] == ["a-tilt"]
