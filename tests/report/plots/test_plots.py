"""The paper's figures and the others: what is drawn is the data, inside the picture, also of odd runs."""

import dataclasses
import html

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.image import imread
from scipy.stats import chi2

from jerkbench.estimate import Attitude, Estimate, Updates
from jerkbench.inspection.facts import overview_figure
from jerkbench.recording import Imu, Position, Recording, Reference
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

N = 400
T_S = 0.1 * np.arange(1, N + 1)


def make_recording(**changes):
    angle = 2 * np.pi * T_S / T_S[-1]
    enu_m = np.column_stack([30 * np.sin(angle), 10 * np.sin(2 * angle), 0 * angle])
    euler = 0.1 * np.column_stack([np.sin(angle), np.cos(angle), angle])
    rng = np.random.default_rng(1)
    values = {
        "position": Position(T_S[::5], enu_m[::5] + 0.3, np.tile(np.eye(3), (N // 5, 1, 1))),
        "reference": Reference(T_S, "drawn", independent=True, enu_m=enu_m, velocity_mps=0 * enu_m, euler_rad=euler),
    }
    imu = Imu(T_S, rng.normal((0.0, 0.0, 9.8), 1.0, size=(N, 3)), rng.normal(size=(N, 3)))
    return Recording("A field", imu, **(values | changes))


def make_estimate(error_m=0.1, seed=2):
    rng = np.random.default_rng(seed)
    recording = make_recording()
    updates = Updates(
        t_s=T_S[::5],
        rows=np.full(80, 6.0),
        nis=rng.chisquare(6, 80),
        nis_used=rng.chisquare(6, 80),
        innovation=rng.normal(size=(80, 6)),
        R_diagonal=rng.uniform(0.01, 0.1, size=(80, 6)),
    )
    updates.R_diagonal[10:20, 1] = np.inf
    return Estimate(
        np.arange(N),
        recording.reference.enu_m + error_m * rng.normal(size=(N, 3)),
        error_m * rng.normal(size=(N, 3)),
        np.tile(np.eye(6) * error_m**2, (N, 1, 1)),
        recording.reference.euler_rad + 0.01,
        updates,
    )


def make_attitude():
    rng = np.random.default_rng(3)
    seen = np.arange(N) % 4 == 0
    return Attitude(T_S, np.tile(np.eye(3), (N, 1, 1)), np.zeros((N, 3)), rng.normal(size=(N, 3)), seen)


def broken_estimate():
    one = make_estimate()
    position_m = one.position_m.copy()
    position_m[200:300] += 1e5 * np.arange(100)[:, None]
    position_m[350:] = np.nan
    return dataclasses.replace(one, position_m=position_m, covariance=-one.covariance, updates=Updates.empty())


def bare():
    return make_recording(reference=Reference(T_S, "none", independent=True), position=None)


def study(cell_rows):
    """Two scenarios, three methods; one diverged."""
    cells = []
    for disturbance, factor in (("none", 1.0), ("bias", 3.0)):
        for filter_name, mean in (("baseline", 2.0), ("jerk", 1.0), ("gnss_only", 50.0)):
            rows = cell_rows(filter_name, "none", [mean * factor, 1.1 * mean * factor])
            cells += [{**row, "disturbance": disturbance} for row in rows]
    cells[-1]["status"] = "diverged"
    return pd.DataFrame(cells)


def swept(cell_rows):
    cells = []
    for sigma in (0.1, 0.2, 0.5):
        rows = cell_rows("jerk", "none", [sigma, 2 * sigma, 1.2 * sigma])
        cells += [{**row, "noise": f"accel_mps2={sigma}"} for row in rows]
    cells[-1]["status"] = "diverged"
    return pd.DataFrame([*cells, *cell_rows("gnss_only", "none", [1.0])])


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


@pytest.mark.slow
@pytest.mark.parametrize("recording", [make_recording(), make_recording(outages_s=np.array([[10.0, 15.0]])), bare()])
@pytest.mark.parametrize("estimate", [make_estimate(), broken_estimate()])
def test_every_figure_of_runs_is_drawn_without_a_warning_and_inside(recording, estimate, tmp_path):
    for name, figure in figures(recording, {"jerk + mtf": estimate, "baseline + none": make_estimate(0.5)}).items():
        figure.draw_without_rendering()
        whole = figure.bbox
        for axes in figure.axes:
            box = axes.get_tightbbox()
            assert box.x0 >= whole.x0 - 2, name
            assert box.x1 <= whole.x1 + 2, name
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
    recording = make_recording()
    assert disturbed_window_s(dataclasses.replace(recording, outages_s=np.array([[10.0, 15.0]])), {}) == (5.0, 25.0)
    one = make_estimate()
    position_m = one.position_m.copy()
    position_m[250] += 5.0
    kicked = dataclasses.replace(one, position_m=position_m)
    low, high = disturbed_window_s(recording, {"a": kicked, "b": one})
    assert (low + high) / 2 == pytest.approx(T_S[250])
    axes = zoomed_error_figure(recording, {"a": kicked, "b": one}, (low, high)).axes[0]
    assert axes.get_xlim() == (low, high)
    quiet = zoomed_error_figure(recording, {"a": kicked, "b": one}, (1.0, 5.0)).axes[0]
    assert quiet.get_ylim()[1] < 1.0 < axes.get_ylim()[1]


@pytest.mark.parametrize("error_m", [0.001, 1.0, 20.0])
def test_the_inset_enlarges_and_its_box_is_inside_the_axes(error_m):
    position_m = make_estimate(0.001).position_m.copy()
    position_m[:, 0] += error_m * np.linspace(0.0, 1.0, N)
    figure = inset_trajectory_figure(
        make_recording(), {"a": dataclasses.replace(make_estimate(), position_m=position_m)}
    )
    main, inset = figure.axes
    for of_axis in ("get_xlim", "get_ylim"):
        (first, last), (low, high) = getattr(main, of_axis)(), getattr(inset, of_axis)()
        assert first <= low < high <= last
    times = np.ptp(main.get_xlim()) / np.ptp(inset.get_xlim())
    assert times >= 4.0
    assert inset.get_title() == f"Enlarged {number(times)} times"
    (bar,) = [line for line in inset.get_lines() if line.get_gid() == "scale"]
    assert f"{np.ptp(bar.get_xdata()):g} m" in [text.get_text() for text in inset.texts]


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


def test_bars_are_the_means_with_their_intervals(cell_rows):
    table = summarise(study(cell_rows), "position_rmse_m")
    panels = bars_figure(table).axes
    heights = [bar.get_height() for axes in panels for bar in axes.patches if np.isfinite(bar.get_height())]
    assert sorted(heights) == pytest.approx(
        sorted(c.mean for row in table.cells for c in row if c is not None and np.isfinite(c.mean))
    )
    assert (
        sum(np.isinf(c.mean) for row in table.cells for c in row if c is not None) == 0
    )  # one lost of two: the other's bar
    assert [axes.get_title() for axes in panels] == ["none", "bias"]
    assert [t.get_text() for t in panels[0].get_xticklabels()] == ["baseline", "jerk", "gnss\nonly"]


def test_the_floor_of_the_reference_is_a_line_through_each_panel_of_the_position_error_alone(cell_rows):
    rows = study(cell_rows).assign(reference_floor_m=0.07)
    (drawn,) = (drawing.figure for drawing in of_rows(rows) if drawing.name == "bars")
    floors = [line.get_ydata()[0] for axes in drawn.axes for line in axes.get_lines() if line.get_linestyle() == "--"]
    (plain,) = (drawing.figure for drawing in of_rows(study(cell_rows)) if drawing.name == "bars")

    assert floors == [0.07] * 2
    assert [line for axes in plain.axes for line in axes.get_lines() if line.get_linestyle() == "--"] == []


def test_of_several_noises_the_best_is_shown(cell_rows):
    rows = swept(cell_rows)
    kept = at_best_noise(rows, "position_rmse_m")
    assert kept.groupby("filter")["position_rmse_m"].apply(list).to_dict() == {
        "jerk": [0.1, 0.2, 0.12],
        "gnss_only": [1.0],
    }
    last = rows["noise"] == "accel_mps2=0.5"
    better = rows.assign(status="ok", position_rmse_m=rows["position_rmse_m"].where(~last, 0.01))
    best = at_best_noise(better, "position_rmse_m")
    assert best.loc[best["filter"] == "jerk", "position_rmse_m"].tolist() == [0.01] * 3
    lost = at_best_noise(better.assign(status=np.where(last, "diverged", "ok")), "position_rmse_m")
    assert lost.loc[lost["filter"] == "jerk", "position_rmse_m"].tolist() == [0.1, 0.2, 0.12]


def test_the_bars_and_the_heat_map_show_the_same_means(cell_rows):
    """One cell has a seed more, and the errors of each scatter: arithmetic means of common seeds are others."""
    rows = study(cell_rows)
    more = rows[(rows["filter"] == "jerk") & (rows["disturbance"] == "none") & (rows["seed"] == rows["seed"].min())]
    rows = pd.concat([rows, more.assign(seed=99, position_rmse_m=4.0)])
    drawn = {one.name: one.figure for one in of_rows(rows[rows["filter"] != "gnss_only"])}
    shown = [text.get_text() for text in drawn["heat-map"].axes[0].texts]
    bars = [text.get_text() for axes in drawn["bars"].axes for text in axes.texts]
    assert sorted(shown) == sorted(bars)
    (jerk,) = [
        errors for key, errors in rows.groupby(["filter", "disturbance"])["position_rmse_m"] if key == ("jerk", "none")
    ]
    assert f"{np.exp(np.log(jerk).mean()):.2f}" in shown


def test_the_heat_map_and_the_profile_are_of_all_scenarios(cell_rows, tmp_path):
    values, _, methods = costs(study(cell_rows), "position_rmse_m")
    table = summarise(study(cell_rows), "position_rmse_m", ["disturbance"], ["filter"])
    figure = heat_map_figure(table, [True] * 3)
    texts = [text.get_text() for text in figure.axes[0].texts]
    assert sorted(texts) == sorted(["2.10", "1.05", "52.4", "6.29", "3.15", "150\n1/2"])
    save_figure(figure, tmp_path / "map.png")
    assert imread(tmp_path / "map.png").std() > 0.01
    lines = {
        line.get_label().split(" (")[0]: line
        for line in profile_figure(values, methods, "RMSE", STYLES[: len(methods)]).axes[0].get_lines()
    }
    assert lines["jerk"].get_ydata()[0] == 100.0
    assert lines["gnss_only"].get_ydata()[-1] == 50.0


def test_lost_runs_are_marked_in_bars_and_heat_map_beside_the_same_number(cell_rows):
    """Of five runs one was lost, of another method all: the table has the mean of the others, and none."""
    rows = pd.concat(
        [
            pd.DataFrame(
                [
                    *cell_rows("jerk", "none", [1.0] * 5),
                    *cell_rows("jerk", "mtf", [0.2, 0.3, 0.4, 0.5, 0.6]),
                    *cell_rows("jerk", "scalar_r", [1.0] * 5),
                ]
            ).assign(disturbance=disturbance)
            for disturbance in ("none", "bias")
        ],
        ignore_index=True,
    )
    biased = rows["disturbance"] == "bias"
    rows.loc[biased & ((rows["adaptation"] == "scalar_r") | (rows["position_rmse_m"] == 0.6)), "status"] = "diverged"
    drawn = {one.name: one.figure for one in of_rows(rows)}
    none, bias = ([text.get_text() for text in axes.texts] for axes in drawn["bars"].axes)
    assert none == ["1.00", "0.373", "1.00"]
    assert bias == ["1.00", "1/5 lost", "0.331", "5/5 lost"]
    alphas = [bar.get_alpha() for bar in drawn["bars"].axes[1].patches]
    assert alphas == [1.0, PALE]
    texts = {text.get_text(): text for text in drawn["heat-map"].axes[0].texts}
    assert set(texts) == {"1.00", "0.373", "0.331\n1/5", "5/5"}
    (image,) = drawn["heat-map"].axes[0].images
    assert image.get_array().mask.tolist() == [[False, False], [False, True], [False, True]]
    assert texts["0.331\n1/5"].get_weight() != "bold"


def test_references_are_shown_and_not_crowned(cell_rows):
    oracle = [row | {"position_rmse_m": 0.01, "adaptation": "oracle"} for row in cell_rows("jerk", "none", [0, 0])]
    rows = study(cell_rows)
    rows = pd.concat([rows, *(pd.DataFrame(oracle).assign(disturbance=name) for name in ("none", "bias"))])
    drawn = {one.name: one for one in of_rows(rows)}
    axes = drawn["heat-map"].figure.axes[0]
    assert [text.get_text() for text in axes.texts if text.get_weight() == "bold"] == ["1.05", "3.15"]
    named = [text.get_text() for text in axes.get_yticklabels()]
    assert named == ["baseline + none", "jerk + none", "(jerk + oracle)", "(gnss_only + none)"]
    labels = [line.get_label() for line in drawn["profile"].figure.axes[0].get_lines()]
    assert sorted(labels) == ["baseline + none (mean rank 2.0)", "jerk + none (mean rank 1.0)"]


def test_who_was_not_run_in_a_scenario_has_not_lost_it(cell_rows):
    rows = study(cell_rows)
    third = rows[rows["disturbance"] == "none"].assign(disturbance="outage")
    rows = pd.concat([rows, third[third["filter"] != "jerk"]])
    drawn = {one.name: one for one in of_rows(rows)}
    assert drawn["profile"].caption == (
        "Performance profiles and mean ranks over the 2 scenarios in which every method was run (of 3). "
        "References do not compete."
    )
    labels = [line.get_label() for line in drawn["profile"].figure.axes[0].get_lines()]
    assert "jerk (mean rank 1.0)" in labels
    assert "profiles" not in drawn["heat-map"].caption


def test_without_two_scenarios_of_every_method_there_is_no_profile_and_that_is_said(cell_rows):
    rows = study(cell_rows)
    drawn = {one.name: one for one in of_rows(rows[(rows["disturbance"] == "none") | (rows["filter"] != "jerk")])}
    assert "profile" not in drawn
    said = "No performance profiles: they need two scenarios in which every method was run (of 2)."
    assert said in drawn["heat-map"].caption


def test_the_sensitivity_is_the_mean_over_sigma(cell_rows):
    rows = swept(cell_rows)
    assert sorted(set(with_noise_sigma(rows)["sigma_a"])) == [0.1, 0.2, 0.5]
    (axes,) = sensitivity_figure(rows, "position_rmse_m").axes
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


def test_a_dollar_in_a_label_of_rows_is_a_dollar(cell_rows, tmp_path):
    rows = study(cell_rows).replace({"filter": {"jerk": FORMULA}, "disturbance": {"bias": f"bias({FORMULA})"}})
    noisy = swept(cell_rows).replace({"filter": {"jerk": FORMULA}, "disturbance": {"none": f"bias({FORMULA})"}})
    drawn = {drawing.name: drawing.figure for drawing in of_rows(rows)}
    drawn["sensitivity"] = sensitivity_figure(noisy, "position_rmse_m")
    looks = STYLES[:2]
    drawn["critical-difference"] = critical_difference_figure(np.array([1.0, 2.0]), 0.5, [FORMULA, "b"], looks, "", 3)
    assert {"bars", "heat-map", "profile"} <= set(drawn)
    for name, figure in drawn.items():
        text = shown(figure, tmp_path / f"{name}.svg")
        assert FORMULA in text, name
        assert f"bias({FORMULA})" in text or name in ("profile", "critical-difference"), name
