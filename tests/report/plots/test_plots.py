"""Figures of runs and of rows: the data, the layout, and unusual runs."""

import dataclasses
import html

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from made_runs import T_S, bare_recording, broken_estimate, make_estimate, make_recording
from matplotlib.image import imread
from scipy.stats import chi2

from jerkbench.inspection.facts import overview_figure
from jerkbench.report.plots.runs import (
    adapted_r_figure,
    consistency_figure,
    error_figure,
    inclination_figure,
    nees,
    trajectory_figure,
)
from jerkbench.report.plots.studies import (
    PALE,
    SIZE,
    bars_figure,
    curves_figure,
    heat_map_figure,
    of_rows,
    swept_rows,
)
from jerkbench.report.plots.style import save_figure
from jerkbench.report.summary import summarise
from jerkbench.report.table_model import number


@pytest.fixture
def study(cell_rows):
    """Two scenarios, three methods; one diverged."""
    cells = []
    for disturbance, factor in (("none", 1.0), ("bias", 3.0)):
        for filter_name, mean in (("baseline", 2.0), ("jerk", 1.0), ("gnss_only", 50.0)):
            cells += cell_rows(filter_name, "none", [mean * factor, 1.1 * mean * factor], disturbance=disturbance)
    cells[-1]["status"] = "diverged"
    return pd.DataFrame(cells)


@pytest.fixture
def swept(cell_rows):
    cells = []
    for sigma in (0.1, 0.2, 0.5):
        cells += cell_rows("jerk", "none", [sigma, 2 * sigma, 1.2 * sigma], noise=f"accel_mps2={sigma}")
    cells[-1]["status"] = "diverged"
    return pd.DataFrame([*cells, *cell_rows("gnss_only", "none", [1.0])])


def drawings(rows):
    return {one.name: one for one in of_rows(rows)}


def texts(axes):
    return [text.get_text() for text in axes.texts]


def figures(recording, estimates):
    return {
        "errors": error_figure(recording, estimates),
        "inclination": inclination_figure(recording, estimates),
        "trajectory": trajectory_figure(recording, estimates),
        "consistency": consistency_figure([(recording, one) for one in estimates.values()], "jerk"),
        "adapted_r": adapted_r_figure(recording, estimates),
    }


RECORDINGS = [make_recording(), make_recording(outages_s=np.array([[10.0, 15.0]])), bare_recording()]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("recording", "estimate"), [*zip(RECORDINGS, (broken_estimate(), make_estimate(), broken_estimate()), strict=True)]
)
def test_every_figure_of_runs_is_drawn_without_a_warning_and_inside(recording, estimate, tmp_path):
    for name, figure in figures(recording, {"jerk + mtf": estimate, "baseline + none": make_estimate(0.5)}).items():
        figure.draw_without_rendering()
        whole = figure.bbox
        for box in (axes.get_tightbbox() for axes in figure.axes):
            assert whole.x0 - 2 <= box.x0 < box.x1 <= whole.x1 + 2, name
            assert box.y0 >= whole.y0 - 2, name
        save_figure(figure, tmp_path / f"{name}.pdf")
        assert (tmp_path / f"{name}.pdf").stat().st_size > 2000


def test_the_adapted_r_is_the_data():
    axes = adapted_r_figure(make_recording(), {"a": make_estimate()}).axes[2]  # north position
    sigma, dropped = axes.get_lines()
    kept = np.r_[0:10, 20:80]
    np.testing.assert_allclose(sigma.get_ydata()[kept], np.sqrt(make_estimate().updates.R_diagonal[kept, 1]))
    assert np.isnan(sigma.get_ydata()[10:20]).all()
    assert axes.get_ylabel() == "North position,\nsigma of R [m]"
    np.testing.assert_allclose(dropped.get_xdata(), T_S[::5][10:20])


def test_nees_is_the_naive_quadratic_form_and_its_band_chi_squares():
    recording, one = make_recording(), make_estimate()
    error = np.hstack([one.position_m - recording.reference.enu_m, one.velocity_mps])
    naive = [e @ np.linalg.inv(P) @ e for e, P in zip(error, one.covariance, strict=True)]
    np.testing.assert_allclose(nees(recording, one), naive)
    runs = [(recording, make_estimate(seed=seed)) for seed in range(5)]
    axes = consistency_figure(runs, "jerk").axes[0]
    (band,) = axes.patches
    assert band.get_y() == pytest.approx(chi2.ppf(0.025, 30) / 5)
    assert band.get_y() + band.get_height() == pytest.approx(chi2.ppf(0.975, 30) / 5)
    inside = float(axes.get_lines()[0].get_label().split(": ")[1].split(" %")[0])
    assert 90 <= inside <= 99  # the errors are drawn from their covariance


def test_bars_and_the_heat_map_are_the_means_of_all_scenarios(study, tmp_path):
    table = summarise(study, "position_rmse_m")
    panels = bars_figure(table).axes
    heights = [bar.get_height() for axes in panels for bar in axes.patches if np.isfinite(bar.get_height())]
    means = [cell.mean for row in table.cells for cell in row if cell is not None]
    assert sorted(heights) == pytest.approx(sorted(means))  # one lost of two: the other's bar
    assert [axes.get_title() for axes in panels] == ["none", "bias"]
    assert [t.get_text() for t in panels[0].get_xticklabels()] == ["baseline", "jerk", "gnss\nonly"]
    figure = heat_map_figure(summarise(study, "position_rmse_m", ["disturbance"], ["filter"]), [True] * 3)
    assert sorted(texts(figure.axes[0])) == sorted(["2.10", "1.05", "52.4", "6.29", "3.15", "150\n1/2"])
    save_figure(figure, tmp_path / "map.png")
    assert imread(tmp_path / "map.png").std() > 0.01


def test_the_sensitivity_is_the_mean_over_sigma(swept):
    assert sorted(set(swept_rows(swept, "noise")[SIZE])) == [0.1, 0.2, 0.5]
    (axes,) = curves_figure(swept_rows(swept, "noise"), "position_rmse_m").axes
    (line,) = [one for one in axes.get_lines() if one.get_label() == "jerk + none"]
    np.testing.assert_allclose(line.get_xdata(), [0.1, 0.2, 0.5])
    np.testing.assert_allclose(line.get_ydata(), [0.14, 0.28, 0.75])
    hollow = [one for one in axes.get_lines() if one.get_marker() == "o" and one.get_markerfacecolor() == "white"]
    assert sum(len(one.get_xdata()) for one in hollow) == 1


@pytest.mark.parametrize(
    "label", ["q={}", "r_scale.position={}", "measured(accel_mps2={})", "measured(bias=0.1, accel_mps2={})"]
)
def test_a_curve_is_drawn_for_each_parameter_of_the_noise_with_three_values(cell_rows, label):
    cells = [cell_rows("jerk", "none", [1.0], noise=label.format(value)) for value in (0.1, 0.2, 1e-3)]
    rows = pd.DataFrame([row for cell in cells for row in cell])

    assert set(swept_rows(rows, "noise")["swept_in"]) == {f"field: none, {label.format('...')}"}
    assert swept_rows(rows[rows["noise"] != label.format(0.1)], "noise").empty


def test_the_bars_and_the_heat_map_show_the_same_means(study):
    """One cell has a seed more, and the errors of each scatter: arithmetic means of common seeds are others."""
    easy = study["disturbance"] == "none"
    more = study[(study["filter"] == "jerk") & easy & (study["seed"] == 0)].assign(seed=99, position_rmse_m=4.0)
    rows = pd.concat([study, more])
    drawn = drawings(rows[rows["filter"] != "gnss_only"])
    shown = texts(drawn["heat-map"].figure.axes[0])
    heights = [bar.get_height() for axes in drawn["bars"].figure.axes for bar in axes.patches]
    assert sorted(shown) == sorted(number(height) for height in heights if np.isfinite(height))
    jerk = rows[(rows["filter"] == "jerk") & (rows["disturbance"] == "none")]["position_rmse_m"]
    assert f"{np.exp(np.log(jerk).mean()):.2f}" in shown


def test_lost_runs_are_marked_in_bars_and_heat_map_beside_the_same_number(cell_rows):
    """Of five runs one was lost, of another method all: the table has the mean of the others, and none."""
    errors = {"none": [1.0] * 5, "mtf": [0.2, 0.3, 0.4, 0.5, 0.6], "scalar_r": [1.0] * 5}
    cells = [cell_rows("jerk", *one, disturbance=name) for name in ("none", "bias") for one in errors.items()]
    rows = pd.DataFrame([row for cell in cells for row in cell])
    biased = rows["disturbance"] == "bias"
    rows.loc[biased & ((rows["adaptation"] == "scalar_r") | (rows["position_rmse_m"] == 0.6)), "status"] = "diverged"
    bars, heat_map = (drawings(rows)[name].figure.axes for name in ("bars", "heat-map"))
    assert texts(bars[0]) == []
    assert texts(bars[1]) == ["1/5 failed", "5/5 failed"]
    assert [bar.get_alpha() for bar in bars[1].patches] == [1.0, PALE]
    weights = {text.get_text(): text.get_weight() for text in heat_map[0].texts}
    assert set(weights) == {"1.00", "0.373", "0.331\n1/5", "5/5"}
    (image,) = heat_map[0].images
    assert image.get_array().mask.tolist() == [[False, False], [False, True], [False, True]]
    assert weights["0.331\n1/5"] != "bold"


def test_references_are_shown_and_not_crowned(study, cell_rows):
    oracle = [row for name in ("none", "bias") for row in cell_rows("jerk", "oracle", [0.01] * 2, disturbance=name)]
    drawn = drawings(pd.concat([study, pd.DataFrame(oracle)]))
    axes = drawn["heat-map"].figure.axes[0]
    assert [text.get_text() for text in axes.texts if text.get_weight() == "bold"] == ["1.05", "3.15"]
    named = [text.get_text() for text in axes.get_yticklabels()]
    assert named == ["baseline + none", "jerk + none", "(jerk + oracle)", "(gnss_only + none)"]


FORMULA = r"$\frac{$"
"""A name that matplotlib would read as a formula, a broken one."""


def shown(figure, path):
    """Return the texts of a figure as they are shown."""
    with mpl.rc_context({"svg.fonttype": "none"}):
        save_figure(figure, path)
    return html.unescape(path.read_text(encoding="utf-8"))


def test_a_dollar_in_a_label_of_a_run_is_a_dollar(tmp_path):
    recording, estimates = make_recording(), {f"jerk + {FORMULA}": make_estimate(), FORMULA: make_estimate(1.0, 4)}
    recording = dataclasses.replace(recording, name=f"A {FORMULA}")
    drawn = {
        **figures(recording, estimates),
        "consistency": consistency_figure([(recording, one) for one in estimates.values()], FORMULA),
        "overview": overview_figure(recording),
    }
    for name, figure in drawn.items():
        text = shown(figure, tmp_path / f"{name}.svg")
        assert f"A {FORMULA}" in text, name
        assert f"jerk + {FORMULA}" in text or name in ("consistency", "overview"), name


def test_a_dollar_in_a_label_of_rows_is_a_dollar(study, tmp_path):
    rows = study.replace({"filter": {"jerk": FORMULA}, "disturbance": {"bias": f"bias({FORMULA})"}})
    drawn = {name: one.figure for name, one in drawings(rows).items()}
    assert {"bars", "heat-map"} <= set(drawn)
    for name, figure in drawn.items():
        text = shown(figure, tmp_path / f"{name}.svg")
        assert FORMULA in text, name
        assert f"bias({FORMULA})" in text, name
