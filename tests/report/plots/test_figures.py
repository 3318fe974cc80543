"""Figures: what is drawn is the data, nothing overlaps, and a strange run is drawn too."""

import dataclasses
from functools import partial

import made_runs
import numpy as np
import pytest
from made_runs import T_S, N, bare_recording, broken_estimate, make_estimate, moved

from jerkbench import plugins
from jerkbench.evaluation.evaluated_run import evaluate_run
from jerkbench.report.plots.runs import error_figure, trajectory_figure

make_recording = partial(made_runs.make_recording, outages_s=np.array([[10.0, 15.0], [20.0, 22.0]]))


def kicked_estimate():
    """Its ticks depend on the height of the axes (found by a scan): a layout that let them clipped the labels."""
    one = make_estimate(0.001)
    return moved(dataclasses.replace(one, covariance=4.0 * one.covariance), 150, [2.05, -1.2, 0.4 / 1.3])


def test_the_error_is_the_norm_and_three_axes_and_its_legend_the_tables_rmse():
    recording, estimate = make_recording(), make_estimate()
    (line,) = error_figure(recording, {"jerk": estimate}, 1, burn_in_s=25.0).axes[0].get_lines()
    values = evaluate_run(estimate, recording, 25.0, [plugins.create("metric", {"name": "position_rmse"})])
    assert line.get_label() == f"jerk: RMSE {values['position_rmse_m']:.3f} m from 25 s on"
    index = np.arange(40, 300)
    estimate = make_estimate(rows=index)
    recording = make_recording()
    scored = np.arange(N) >= 100
    recording = dataclasses.replace(recording, reference=dataclasses.replace(recording.reference, scored=scored))
    truth = recording.reference.enu_m
    (line,) = error_figure(recording, {"jerk": estimate}).axes[0].get_lines()
    norm = np.array([np.linalg.norm(p - q) for p, q in zip(estimate.position_m, truth[index], strict=True)])
    np.testing.assert_array_equal(line.get_xdata(), T_S[index])
    np.testing.assert_allclose(line.get_ydata(), norm, rtol=1e-12)
    assert line.get_label() == f"jerk: RMSE {np.sqrt(np.mean(norm[60:] ** 2)):.3f} m"
    recording, estimate = make_recording(), make_estimate()
    first, *three = error_figure(recording, {"jerk": estimate}).axes
    assert first.get_ylabel() == "Position error [m]"
    for axis, (name, axes) in enumerate(zip(("East", "North", "Up"), three, strict=True)):
        assert axes.get_ylabel() == f"{name} error [m]"
        (line,), (band,) = axes.get_lines(), axes.collections
        error = estimate.position_m[:, axis] - recording.reference.enu_m[:, axis]
        np.testing.assert_allclose(line.get_ydata(), error, atol=1e-12)
        assert band.get_paths()[0].get_extents().height == pytest.approx(2 * 3 * 0.1)
    (axes,) = error_figure(bare_recording(), {"one": make_estimate()}).axes
    assert [text.get_text() for text in axes.texts] == ["The recording has no position reference."]


def texts(figure):
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_the_trajectory_is_the_data_to_scale_whoever_leaves_the_picture():
    recording, estimates = make_recording(), {"jerk + none": make_estimate(), "baseline + mtf": make_estimate(0.5)}
    axes = trajectory_figure(recording, estimates).axes[0]
    drawn = {line.get_label(): line for line in axes.get_lines()}
    np.testing.assert_array_equal(drawn["reference"].get_xydata(), recording.reference.enu_m[:, :2])
    np.testing.assert_array_equal(drawn["measured"].get_xydata(), recording.position.enu_m[:, :2])
    for name, estimate in estimates.items():
        np.testing.assert_array_equal(drawn[name].get_xydata(), estimate.position_m[:, :2])
    assert drawn["reference"].get_color() == "black"
    assert drawn["jerk + none"].get_color() != drawn["baseline + mtf"].get_color()
    assert axes.get_aspect() == 1.0
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("East [m]", "North [m]")
    recording = make_recording()
    good, bad = {"jerk": make_estimate()}, {"jerk": make_estimate(), "mtf": broken_estimate()}
    assert "mtf (leaves the picture)" in texts(trajectory_figure(recording, bad))
    limits = [trajectory_figure(recording, estimates).axes[0].get_xlim() for estimates in (good, bad)]
    assert limits[0] == limits[1]
    assert limits[0][1] < 50


@pytest.mark.parametrize(("estimate", "scale"), [(make_estimate(), "linear"), (broken_estimate(), "log")])
def test_a_wide_spread_is_logarithmic(estimate, scale):
    assert error_figure(make_recording(), {"one": estimate}).axes[0].get_yscale() == scale


@pytest.mark.parametrize("draw", [trajectory_figure, error_figure])
@pytest.mark.parametrize(
    ("estimate", "count", "length"),
    [(None, 0, 0), (kicked_estimate(), 1, 11), (broken_estimate(), 8, 16), (kicked_estimate(), 8, 36)],
)
def test_everything_is_inside_and_the_legend_apart(draw, count, length, estimate):
    names = [f"{k}{'gnss_only + variational_bayes_and_more'[:length]}" for k in range(count)]
    apart = {name: moved(estimate, slice(None), 0.3 * k) for k, name in enumerate(names)}  # so that no two coincide
    figure = draw(make_recording(), apart)
    figure.draw_without_rendering()
    whole = figure.bbox
    boxes = [axes.get_tightbbox() for axes in figure.axes]
    legend = figure.legends[0].get_window_extent()
    for box in (*boxes, legend):
        assert whole.x0 - 1 <= box.x0 < box.x1 <= whole.x1 + 1
        assert whole.y0 - 1 <= box.y0 < box.y1 <= whole.y1 + 1
    assert legend.y1 <= min(box.y0 for box in boxes) + 1
