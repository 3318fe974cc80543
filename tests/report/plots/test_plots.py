"""The paper's figures and the others: what is drawn is the data, inside the picture, also of odd runs."""

import dataclasses
import html

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from made_runs import T_S, N, bare_recording, broken_estimate, make_estimate, make_recording, moved
from matplotlib.image import imread
from scipy.stats import chi2

from jerkbench.estimate import Attitude
from jerkbench.inspection.facts import overview_figure
from jerkbench.report.drawings import of_rows
from jerkbench.report.plots.bars import PALE, bars_figure, critical_difference_figure, heat_map_figure, profile_figure
from jerkbench.report.plots.consistency import (
    acceleration_figure,
    adapted_r_figure,
    consistency_figure,
    nees,
    tilt_figure,
)
from jerkbench.report.plots.runs import (
    disturbed_window_s,
    error_figure,
    inclination_figure,
    inset_trajectory_figure,
    trajectory_figure,
    zoomed_error_figure,
)
from jerkbench.report.plots.style import Palette, save_figure
from jerkbench.report.plots.sweeps import sensitivity_figure, with_noise_sigma
from jerkbench.report.summary import summarise
from jerkbench.report.sweeps import at_best_noise, costs
from jerkbench.report.table_model import number

STYLES = [Palette.of([(name, "none") for name in "abcdef"]).look((name, "none")) for name in "abcdef"]


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


def make_attitude():
    rng = np.random.default_rng(3)
    seen = np.arange(N) % 4 == 0
    return Attitude(T_S, np.tile(np.eye(3), (N, 1, 1)), np.zeros((N, 3)), rng.normal(size=(N, 3)), seen)


def figures(recording, estimates):
    window_s = disturbed_window_s(recording, estimates)
    return {
        "tilt": tilt_figure(recording, estimates),
        "acceleration": acceleration_figure(recording, make_attitude()),
        "zoom": zoomed_error_figure(recording, estimates, window_s),
        "inset": inset_trajectory_figure(recording, estimates),
        "consistency": consistency_figure([(recording, one) for one in estimates.values()], "jerk"),
        "adapted_r": adapted_r_figure(recording, estimates),
    }


RECORDINGS = [make_recording(), make_recording(outages_s=np.array([[10.0, 15.0]])), bare_recording()]


@pytest.mark.slow
@pytest.mark.parametrize("recording", RECORDINGS)
@pytest.mark.parametrize("estimate", [make_estimate(), broken_estimate()])
def test_every_figure_of_runs_is_drawn_without_a_warning_and_inside(recording, estimate, tmp_path):
    for name, figure in figures(recording, {"jerk + mtf": estimate, "baseline + none": make_estimate(0.5)}).items():
        figure.draw_without_rendering()
        whole = figure.bbox
        for box in (axes.get_tightbbox() for axes in figure.axes):
            assert whole.x0 - 2 <= box.x0 < box.x1 <= whole.x1 + 2, name
            assert box.y0 >= whole.y0 - 2, name
        save_figure(figure, tmp_path / f"{name}.pdf")
        assert (tmp_path / f"{name}.pdf").stat().st_size > 2000


def test_the_tilt_is_the_data_and_its_bars_the_rmse():
    figure = tilt_figure(make_recording(), {"mtf": make_estimate()})
    roll, pitch, first, second = figure.axes
    estimated, truth = roll.get_lines()
    np.testing.assert_allclose(estimated.get_ydata(), np.degrees(make_estimate().euler_rad[:, 0]))
    np.testing.assert_allclose(truth.get_ydata(), np.degrees(make_recording().reference.euler_rad[:, 0]))
    for axes in (first, second):
        (bar,) = axes.patches
        assert bar.get_height() == pytest.approx(np.degrees(0.01))
    assert pitch.get_ylabel() == "Pitch [deg]"


def test_the_acceleration_is_raw_and_compensated():
    figure = acceleration_figure(make_recording(), make_attitude())
    for axis, axes in enumerate(figure.axes):
        raw, compensated, *_ = axes.get_lines()
        np.testing.assert_array_equal(raw.get_ydata(), make_recording().imu.accel_mps2[:, axis])
        np.testing.assert_array_equal(compensated.get_ydata(), make_attitude().accel_enu_mps2[:, axis])
    assert "external acceleration seen (25 % of samples)" in [t.get_text() for t in figure.legends[0].get_texts()]


def test_the_zoom_is_around_an_outage_or_the_largest_error():
    recording, one = make_recording(), make_estimate()
    assert disturbed_window_s(dataclasses.replace(recording, outages_s=np.array([[10.0, 15.0]])), {}) == (5.0, 25.0)
    both = {"a": moved(one, 250, 5.0), "b": one}
    low, high = disturbed_window_s(recording, both)
    assert (low + high) / 2 == pytest.approx(T_S[250])
    axes = zoomed_error_figure(recording, both, (low, high)).axes[0]
    assert axes.get_xlim() == (low, high)
    quiet = zoomed_error_figure(recording, both, (1.0, 5.0)).axes[0]
    assert quiet.get_ylim()[1] < 1.0 < axes.get_ylim()[1]


@pytest.mark.parametrize("error_m", [0.001, 1.0, 20.0])
def test_the_inset_enlarges_and_its_box_is_inside_the_axes(error_m):
    leaving = moved(make_estimate(0.001), (slice(None), 0), error_m * np.linspace(0.0, 1.0, N))
    main, inset = inset_trajectory_figure(make_recording(), {"a": leaving}).axes
    for of_axis in ("get_xlim", "get_ylim"):
        (first, last), (low, high) = getattr(main, of_axis)(), getattr(inset, of_axis)()
        assert first <= low < high <= last
    times = np.ptp(main.get_xlim()) / np.ptp(inset.get_xlim())
    assert times >= 4.0
    assert inset.get_title() == f"Enlarged {number(times)} times"
    (bar,) = [line for line in inset.get_lines() if line.get_gid() == "scale"]
    assert f"{np.ptp(bar.get_xdata()):g} m" in texts(inset)


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


def test_adapted_r_is_a_sigma_with_ticks_where_a_row_was_dropped():
    axes = adapted_r_figure(make_recording(), {"a": make_estimate()}).axes[2]  # north position
    sigma, dropped = axes.get_lines()
    kept = np.r_[0:10, 20:80]
    np.testing.assert_allclose(sigma.get_ydata()[kept], np.sqrt(make_estimate().updates.R_diagonal[kept, 1]))
    assert np.isnan(sigma.get_ydata()[10:20]).all()
    assert axes.get_ylabel() == "North position,\nsigma of R [m]"
    np.testing.assert_allclose(dropped.get_xdata(), T_S[::5][10:20])


def test_bars_are_the_means_with_their_intervals(study):
    table = summarise(study, "position_rmse_m")
    panels = bars_figure(table).axes
    heights = [bar.get_height() for axes in panels for bar in axes.patches if np.isfinite(bar.get_height())]
    means = [cell.mean for row in table.cells for cell in row if cell is not None]
    assert sorted(heights) == pytest.approx(sorted(means))  # one lost of two: the other's bar
    assert [axes.get_title() for axes in panels] == ["none", "bias"]
    assert [t.get_text() for t in panels[0].get_xticklabels()] == ["baseline", "jerk", "gnss\nonly"]


@pytest.mark.parametrize("floor", [{"reference_floor_m": 0.07}, {}])
def test_the_floor_of_the_reference_is_a_line_through_each_panel_of_the_position_error_alone(study, floor):
    lines = [line for axes in drawings(study.assign(**floor))["bars"].figure.axes for line in axes.get_lines()]

    assert [line.get_ydata()[0] for line in lines if line.get_linestyle() == "--"] == [0.07] * 2 * len(floor)


def test_of_several_noises_the_best_is_shown(swept):
    def errors_of_jerk(rows):
        kept = at_best_noise(rows, "position_rmse_m")
        return kept.loc[kept["filter"] == "jerk", "position_rmse_m"].tolist()

    assert errors_of_jerk(swept) == [0.1, 0.2, 0.12]
    assert set(at_best_noise(swept, "position_rmse_m")["filter"]) == {"jerk", "gnss_only"}
    last = swept["noise"] == "accel_mps2=0.5"
    better = swept.assign(status="ok", position_rmse_m=swept["position_rmse_m"].where(~last, 0.01))
    assert errors_of_jerk(better) == [0.01] * 3
    assert errors_of_jerk(better.assign(status=np.where(last, "diverged", "ok"))) == [0.1, 0.2, 0.12]


def test_the_bars_and_the_heat_map_show_the_same_means(study):
    """One cell has a seed more, and the errors of each scatter: arithmetic means of common seeds are others."""
    easy = study["disturbance"] == "none"
    more = study[(study["filter"] == "jerk") & easy & (study["seed"] == 0)].assign(seed=99, position_rmse_m=4.0)
    rows = pd.concat([study, more])
    drawn = drawings(rows[rows["filter"] != "gnss_only"])
    shown = texts(drawn["heat-map"].figure.axes[0])
    assert sorted(shown) == sorted(text for axes in drawn["bars"].figure.axes for text in texts(axes))
    jerk = rows[(rows["filter"] == "jerk") & (rows["disturbance"] == "none")]["position_rmse_m"]
    assert f"{np.exp(np.log(jerk).mean()):.2f}" in shown


def test_the_heat_map_and_the_profile_are_of_all_scenarios(study, tmp_path):
    values, _, methods, _ = costs(study, "position_rmse_m")
    figure = heat_map_figure(summarise(study, "position_rmse_m", ["disturbance"], ["filter"]), [True] * 3)
    assert sorted(texts(figure.axes[0])) == sorted(["2.10", "1.05", "52.4", "6.29", "3.15", "150\n1/2"])
    save_figure(figure, tmp_path / "map.png")
    assert imread(tmp_path / "map.png").std() > 0.01
    (axes,) = profile_figure(values, methods, "RMSE", STYLES[: len(methods)]).axes
    lines = {line.get_label().split(" (")[0]: line for line in axes.get_lines()}
    assert lines["jerk"].get_ydata()[0] == 100.0
    assert lines["gnss_only"].get_ydata()[-1] == 50.0


def test_lost_runs_are_marked_in_bars_and_heat_map_beside_the_same_number(cell_rows):
    """Of five runs one was lost, of another method all: the table has the mean of the others, and none."""
    errors = {"none": [1.0] * 5, "mtf": [0.2, 0.3, 0.4, 0.5, 0.6], "scalar_r": [1.0] * 5}
    cells = [cell_rows("jerk", *one, disturbance=name) for name in ("none", "bias") for one in errors.items()]
    rows = pd.DataFrame([row for cell in cells for row in cell])
    biased = rows["disturbance"] == "bias"
    rows.loc[biased & ((rows["adaptation"] == "scalar_r") | (rows["position_rmse_m"] == 0.6)), "status"] = "diverged"
    bars, heat_map = (drawings(rows)[name].figure.axes for name in ("bars", "heat-map"))
    assert texts(bars[0]) == ["1.00", "0.373", "1.00"]
    assert texts(bars[1]) == ["1.00", "1/5 lost", "0.331", "5/5 lost"]
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
    labels = [line.get_label() for line in drawn["profile"].figure.axes[0].get_lines()]
    assert sorted(labels) == ["baseline + none (mean rank 2.0)", "jerk + none (mean rank 1.0)"]


def test_who_was_not_run_in_a_scenario_has_not_lost_it(study):
    third = study[(study["disturbance"] == "none") & (study["filter"] != "jerk")].assign(disturbance="outage")
    drawn = drawings(pd.concat([study, third]))
    assert drawn["profile"].caption == (
        "Performance profiles and mean ranks over the 2 scenarios in which every method was run (of 3). "
        "References do not compete."
    )
    assert "jerk (mean rank 1.0)" in [line.get_label() for line in drawn["profile"].figure.axes[0].get_lines()]
    assert "profiles" not in drawn["heat-map"].caption


def test_without_two_scenarios_of_every_method_there_is_no_profile_and_that_is_said(study):
    drawn = drawings(study[(study["disturbance"] == "none") | (study["filter"] != "jerk")])
    assert "profile" not in drawn
    said = "No performance profiles: they need two scenarios in which every method was run (of 2)."
    assert said in drawn["heat-map"].caption


def test_the_sensitivity_is_the_mean_over_sigma(swept):
    assert sorted(set(with_noise_sigma(swept)["sigma_a"])) == [0.1, 0.2, 0.5]
    (axes,) = sensitivity_figure(swept, "position_rmse_m").axes
    (line,) = [one for one in axes.get_lines() if one.get_label() == "jerk + none"]
    np.testing.assert_allclose(line.get_xdata(), [0.1, 0.2, 0.5])
    np.testing.assert_allclose(line.get_ydata(), [0.14, 0.28, 0.75])
    hollow = [one for one in axes.get_lines() if one.get_marker() == "o" and one.get_markerfacecolor() == "white"]
    assert len(hollow) == 1


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
        "trajectory": trajectory_figure(recording, estimates),
        "errors": error_figure(recording, estimates),
        "inclination": inclination_figure(recording, estimates),
        "overview": overview_figure(recording),
    }
    for name, figure in drawn.items():
        text = shown(figure, tmp_path / f"{name}.svg")
        assert f"A {FORMULA}" in text, name
        assert f"jerk + {FORMULA}" in text or name in ("acceleration", "consistency", "overview"), name


def test_a_dollar_in_a_label_of_rows_is_a_dollar(study, swept, tmp_path):
    rows = study.replace({"filter": {"jerk": FORMULA}, "disturbance": {"bias": f"bias({FORMULA})"}})
    noisy = swept.replace({"filter": {"jerk": FORMULA}, "disturbance": {"none": f"bias({FORMULA})"}})
    drawn = {name: one.figure for name, one in drawings(rows).items()}
    assert {"bars", "heat-map", "profile"} <= set(drawn)
    drawn["sensitivity"] = sensitivity_figure(noisy, "position_rmse_m")
    ranks = np.array([1.0, 2.0]), 0.5, [FORMULA, "b"], STYLES[:2], "", 3
    drawn["critical-difference"] = critical_difference_figure(*ranks)
    for name, figure in drawn.items():
        text = shown(figure, tmp_path / f"{name}.svg")
        assert FORMULA in text, name
        assert f"bias({FORMULA})" in text or name in ("profile", "critical-difference"), name
