"""The report: one file, everything in it, and it opens in a browser."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from commands import swept
from jerkbench.jobs.store import Store
from jerkbench.jobs.study import row_of
from jerkbench.report.page import page, review, settings
from jerkbench.report.plots.studies import Picture
from jerkbench.report.summary import TUNED

SWEEP = ["filter=baseline,jerk", "adaptation=none,mtf", "disturbance=none,multipath_single_axis", "seeds=2"]


@pytest.mark.slow
def test_a_sweep_ends_with_all_figures_where_they_are_asked_for(sweep, report):
    assert "Drawing the figures (figures=few, all or none)." in sweep[1].stdout
    assert f"Report: {Path('results/adhoc/report.html')}" in sweep[1].stdout
    drawn = {path.stem for path in (report.parent / "figures").glob("*.png")}
    assert len(list((report.parent / "figures").iterdir())) == len(drawn), "a PDF is there only when it is asked for"
    of_runs = {f"field_{where}_field" for where in ("none", "multipath_single_axis")}  # and a hash of the whole name
    kinds = ("errors", "trajectory", "three-sigma", "inclination", "consistency", "adapted-r")
    named = {f"{scene}-{kind}" for scene in of_runs for kind in kinds}
    short = {re.sub("-[0-9a-f]{8}-", "-", name, count=1) for name in drawn}
    assert short == {"bars", "heat-map", *named}


@pytest.mark.slow
def test_a_report_without_figures_is_quick_to_have(report, tmp_path):
    shutil.copytree(report.parent / "cells", tmp_path / "results" / "adhoc" / "cells")
    done = swept(*SWEEP, "dataset.duration_s=60", "report=true", cwd=tmp_path)
    assert "8 of 8 combinations are already complete" in done.stderr
    assert "Drawing" not in done.stdout
    assert not (tmp_path / "results" / "adhoc" / "figures").exists()
    text = (tmp_path / "results" / "adhoc" / "report.html").read_text(encoding="utf-8")
    assert "No figures were drawn." in text
    assert "No runs were drawn" in text
    assert "A reviewer's questions" in text


@pytest.mark.slow
def test_it_is_one_file_that_asks_for_nothing(report):
    text = report.read_text(encoding="utf-8")
    assert not re.findall(r"(?:src|href)=\"(?!data:image/webp;base64,|#)", text)
    ours = re.sub(
        r"base64,[^\"]*|<script>/\*! https://github.com/leeoniya/uPlot.*?</script>", "", text, flags=re.DOTALL
    )
    assert "http" not in ours.replace("<meta http-equiv=", "")
    assert images_of(text) in (7, 12)  # two of all rows, five of a scenario: as many scenarios as there is room for
    assert len(text) < 2_000_000


def images_of(text):
    return text.count("data:image/webp;base64,")


def told(report):
    text = report.read_text(encoding="utf-8")
    return json.loads(re.search(r'id="traces-data">(.*?)</script>', text)[1])


@pytest.mark.slow
def test_the_lines_are_the_errors_of_the_first_run_of_every_cell(report):
    traces = told(report)
    assert [len(one["lines"]) for one in traces["scenarios"]] == [4, 4]
    for scenario in traces["scenarios"]:
        for line in scenario["lines"]:
            (stored,), _ = Store(report.parent).read([line["key"]])
            recording, estimate = row_of(stored).run()
            error = np.linalg.norm(estimate.position_m - recording.reference.enu_m[estimate.index], axis=1)
            shown = np.array([value for value in line["error"] if value is not None])
            assert shown.max() == pytest.approx(error.max(), rel=1e-3)
            assert shown.min() >= error.min() * (1 - 1e-3)


def click(opened, selector):
    opened.execute_script("arguments[0].click()", opened.find_element("css selector", selector))


def ranges(opened):
    boxes = [opened.find_element("id", name) for name in ("trace-error", "trace-ratio")]
    return [tuple(map(float, box.get_attribute("data-range").split())) for box in boxes]


@pytest.mark.slow
def test_two_methods_are_drawn_and_both_plots_zoom_together(opened):
    whole = ranges(opened)
    assert whole[0] == whole[1]
    click(opened, "[data-zoom=in]")
    near = ranges(opened)
    assert near[0] == near[1]
    assert near[0][1] - near[0][0] == pytest.approx((whole[0][1] - whole[0][0]) / 2)
    opened.find_element("id", "trace-ratio").send_keys("0")
    assert ranges(opened)[0] == ranges(opened)[1] == pytest.approx(whole[0])
    select = opened.find_element("id", "trace-b")
    select.find_element("xpath", "./option[contains(text(), 'jerk + mtf')]").click()
    assert "jerk + mtf" in opened.find_element("id", "trace-error").text


@pytest.mark.slow
def test_what_is_in_a_fold_is_seen_when_it_is_opened(opened, report):
    fold = opened.find_element("css selector", "#section-figures details:last-of-type")
    figure = fold.find_element("css selector", "img")
    assert not figure.is_displayed()
    opened.execute_script("arguments[0].click()", fold.find_element("css selector", "summary"))
    assert figure.is_displayed()
    images = opened.find_elements("css selector", "figure img")
    assert len(images) == images_of(report.read_text(encoding="utf-8"))
    opened.execute_script("for (const one of document.images) one.loading = 'eager';")
    sizes = opened.execute_async_script(
        "const done = arguments[0];"
        "Promise.all([...document.images].map((one) => one.decode().then(() => one.naturalWidth))).then(done);"
    )
    assert min(sizes) > 500


@pytest.mark.slow
def test_the_browser_has_nothing_to_complain_about(opened):
    assert [one for one in opened.get_log("browser") if one["level"] != "INFO"] == []


LABELS = {"disturbance": "none", "attitude": "tilt", "filter": "jerk", "adaptation": "none"}


def cell(filter_parameter=1.0, dataset="field", data="", window=1, independent="independent of", plugin="", **more):
    spec = {
        "dataset": {"name": plugin or dataset, **more},
        "filter": {"name": "jerk", "accel_mps2": filter_parameter},
        "adaptation": {"name": "mtf", "window": window},
        "attitude": {"name": "tilt"},
    }
    labels = {**LABELS, "dataset": dataset, "noise": f"accel_mps2={filter_parameter}"}
    notes = [f"Reference of {dataset}: drawn; {independent} the measurements."]
    return {"labels": labels, "spec": spec, "data": data, "notes": notes}


def changed(one, labels=(), spec=(), **more):
    """The cell with other labels, and other parts of its configuration."""
    return {**one, **more, "labels": {**one["labels"], **dict(labels)}, "spec": {**one["spec"], **dict(spec)}}


def other(parameter, window):
    """A cell of another method, whose windows are its own."""
    spec = {"filter": {"name": "baseline", "accel_mps2": 1.0}}
    return changed(cell(parameter, window=window), {"filter": "baseline"}, spec)


def checks(cells, seeds=12, anees=6.0, replicate="seed", lost=0):
    rows = [
        {**one["labels"], "seed": seed, "replicate": replicate, "status": "ok", "reason": ""}
        | {"position_rmse_m": 1.0 + 0.1 * seed, "anees": anees}
        | ({"status": "diverged"} if seed < lost else {})
        for one in cells
        for seed in range(seeds)
    ]
    keys = ("covariance", "budget", "recordings", "seeds", "consistency", "independence")
    return dict(zip(keys, review(pd.DataFrame(rows), cells, "position_rmse_m"), strict=True))


def answers(cells, **more):
    return {key: one.passed for key, one in checks(cells, **more).items()}


TOLD = changed(cell(1, data="hash"), spec={"filter": {"name": "eskf15", "position_sigma_m": 1.0}})
GOOD = [cell(k, dataset, window=k) for k in (1, 2, 3) for dataset in ("field", "field_ruts")]


OVERLAP = "The presets were tuned on the seeds 0 to 7, and 8 of them are run again, so the errors are too optimistic."


def tuned(one, trials=64):
    """The cell, with the note of a preset that was tuned."""
    return changed(one, notes=[*one["notes"], f"{TUNED}trials={trials}."])


def test_methods_that_were_tuned_elsewhere_with_the_same_budget_pass_the_review():
    assert answers([tuned(cell(1)), tuned(other(1, 1))])["budget"] is True


def test_a_good_study_passes_the_review():
    assert answers(GOOD) == {**dict.fromkeys(answers(GOOD), True), "covariance": None}
    assert answers([changed(one, data="hash") for one in GOOD])["covariance"] is True


PHASES, ONE_RUN = "are phases of recordings", "are the one run of a recording in which nothing is random"


@pytest.mark.parametrize(("runs", "said", "not_said"), [(1, ONE_RUN, PHASES), (4, PHASES, ONE_RUN)])
def test_only_what_was_withheld_has_phases(runs, said, not_said):
    reason = checks(GOOD, seeds=runs, replicate="phase")["seeds"].reason
    assert f"{runs * len(GOOD)} rows {said}" in reason
    assert not_said not in reason


@pytest.mark.parametrize(
    ("question", "cells", "more"),
    [
        ("covariance", [cell(k, data="hash", position_sigma_m=1.0) for k in (1, 2, 3)], {}),
        ("budget", [cell(1)], {}),
        ("recordings", [cell(k) for k in (1, 2, 3)], {}),
        ("seeds", GOOD, {"seeds": 5}),
        ("seeds", GOOD, {"replicate": "phase"}),
        ("consistency", GOOD, {"anees": 60.0}),
        ("consistency", GOOD, {"anees": float("nan")}),
        ("independence", [*GOOD, cell(dataset="drive", independent="not independent of")], {}),
        ("budget", [*GOOD, *(other(w, w) for w in (1, 2, 3, 4))], {}),
        ("budget", [*GOOD, cell(4, "field_ruts", window=4)], {}),
        ("budget", [tuned(cell(1)), tuned(other(1, 1), trials=16)], {}),
        ("budget", [tuned(cell(1)), *(other(w, w) for w in (1, 2, 3))], {}),
        ("covariance", [TOLD], {}),
        ("recordings", [cell(k, f"field(duration_s={k})", plugin="field") for k in (30, 60)], {}),
        ("recordings", [cell(k, name, data="same") for k in (1, 2) for name in ("drive", "ride")], {}),
        ("recordings", [*GOOD, other(1, 1)], {}),
        ("seeds", GOOD, {"lost": 3}),
        ("seeds", [*GOOD[1:], changed(GOOD[0], notes=[*GOOD[0]["notes"], OVERLAP])], {}),
        ("consistency", GOOD, {"lost": 12}),
        ("independence", [*GOOD, changed(cell(dataset="drive"), notes=["drive has no reference: none."])], {}),
    ],
)
def test_what_is_missing_fails_the_review(question, cells, more):
    assert answers(cells, **more)[question] is False


def test_the_reason_names_the_seeds_that_a_tuning_used():
    cells = [changed(one, notes=[*one["notes"], OVERLAP]) for one in GOOD]

    assert checks(cells)["seeds"].reason.endswith(f" {OVERLAP}")


def test_the_settings_of_a_method_contain_the_factors_on_r():
    scaled = changed(cell(0.04), spec={"r_scale": {"position": 3.7, "velocity": 1.0}})

    assert settings([scaled]) == [
        ("jerk + none", "filter.accel_mps2 0.0400, adaptation.window 1, r_scale.position 3.70")
    ]


def test_what_the_log_reports_is_no_replacement():
    reported = {"position_sigma": ["sdn", "sde", "sdu"], "position_sigma_m": 1.0, "velocity_sigma_mps": []}
    reported |= {"velocity_sigma_mps": 0.1, "velocity_file": ""}  # this log has no such measurements
    cells = [cell(k, data="hash", covariance_order="neu", **reported) for k in (1, 2, 3)]
    assert answers(cells)["covariance"] is True


def test_a_reference_needs_no_budget_and_is_not_the_best():
    oracle = changed(cell(9), {"adaptation": "oracle"})
    assert answers([*GOOD, oracle])["budget"] is True
    rows = [{**one["labels"], "seed": 0, "replicate": "seed", "status": "ok"} for one in [*GOOD, oracle]]
    values = {"position_rmse_m": [2.0] * len(GOOD) + [1.0], "anees": [6.0] * len(GOOD) + [600.0]}
    found = review(pd.DataFrame(rows).assign(reason="", **values), [*GOOD, oracle], "position_rmse_m")
    assert [one.passed for one in found if one.question.startswith("Are the best")] == [True]


def test_what_stands_in_a_study_cannot_break_the_page(cell_rows):
    nasty = '<script>alert("x")</script>&'
    rows = pd.DataFrame(cell_rows(nasty, "none", [1.0, 2.0]))
    record = {"protocol": {}, "created": "", "seconds": 0, "commit": "", "versions": {}, "notes": [nasty]}
    about = changed(cell(), {"filter": nasty}, **record)
    line = {"key": "k", "name": nasty, "colour": "#000000", "dash": (), "error": [1.0, None, 2.0]}
    curves = {"name": nasty, "draw": "seed 0", "start": 0.0, "step": 1.0, "outages": [], "lines": [line]}
    results = nasty, rows, {"k": about}, (nasty,), {nasty: nasty}
    text = page(*results, [Picture(nasty, nasty, nasty, "data:image/webp;base64,", 1, 1)], [curves])
    assert "<script>alert" not in text
    assert text.count("alert") > 5
