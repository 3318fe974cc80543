"""One colour a filter and one line style an adaptation, in every figure."""

import numpy as np
import pandas as pd
import pytest
from matplotlib.colors import to_hex

from jerkbench.estimate import Estimate, Updates
from jerkbench.recording import Position, Recording, Reference
from jerkbench.report.drawings import of_rows, palette_of
from jerkbench.report.plots.consistency import adapted_r_figure, tilt_figure
from jerkbench.report.plots.runs import (
    error_figure,
    inclination_figure,
    inset_trajectory_figure,
    trajectory_figure,
    zoomed_error_figure,
)
from jerkbench.report.plots.style import COLOURS, Palette, method_of

N = 50
METHODS = ("jerk + mtf", "jerk + none", "bias + mtf", "bias + none")
STUDY = Palette.of(
    [("gnss_only", "none"), *((f, a) for f in ("baseline", "jerk", "bias") for a in ("none", "huber", "mtf"))]
)
PLAIN = {"-", "None"}


@pytest.fixture
def recording():
    t_s = np.arange(1.0, N + 1)
    enu_m = np.column_stack([t_s, np.sin(t_s), 0 * t_s])
    reference = Reference(t_s, "drawn", independent=True, enu_m=enu_m, euler_rad=0.1 * enu_m)
    position = Position(t_s, enu_m, np.tile(np.eye(3), (N, 1, 1)))
    return Recording("A field", None, position=position, reference=reference)


@pytest.fixture
def estimates(recording):
    rng = np.random.default_rng(1)
    t_s, truth = recording.reference.t_s, recording.reference
    return {
        name: Estimate(
            np.arange(N),
            truth.enu_m + rng.normal(size=(N, 3)),
            np.zeros((N, 3)),
            np.tile(np.eye(6), (N, 1, 1)),
            truth.euler_rad + 0.1 * rng.normal(size=(N, 3)),
            Updates(t_s, *(np.ones(N) for _ in range(3)), np.zeros((N, 6)), rng.uniform(1.0, 2.0, (N, 6))),
        )
        for name in METHODS
    }


def figures(recording, estimates):
    return {
        "errors": error_figure(recording, estimates, palette=STUDY),
        "zoom": zoomed_error_figure(recording, estimates, (3.0, 30.0), palette=STUDY),
        "trajectory": trajectory_figure(recording, estimates, STUDY),
        "inset": inset_trajectory_figure(recording, estimates, STUDY),
        "adapted-r": adapted_r_figure(recording, estimates, STUDY),
        "tilt": tilt_figure(recording, estimates, STUDY),
        "inclination": inclination_figure(recording, estimates, STUDY),
    }


def drawn(figure):
    """Colour, and whether the line is a full one, of each method that the figure names."""
    lines = [line for axes in figure.axes for line in axes.get_lines()]
    named = {line.get_label().split(":")[0].split(" (")[0]: line for line in lines}
    return {
        name: (to_hex(named[name].get_color()).upper(), named[name].get_linestyle() in PLAIN)
        for name in named
        if " + " in name
    }


@pytest.mark.parametrize("chosen", [METHODS, METHODS[::-1], METHODS[2:]])
def test_every_figure_of_runs_draws_a_method_alike_whatever_else_is_in_it(recording, estimates, chosen):
    blue = {"jerk": COLOURS[2], "bias": COLOURS[3]}
    for kind, figure in figures(recording, {name: estimates[name] for name in chosen}).items():
        expected = {name: (blue[name[:4]].upper(), name.endswith("none")) for name in chosen}
        assert drawn(figure) == expected, kind


def test_every_figure_of_rows_draws_a_method_as_the_figures_of_runs_do(cell_rows):
    rng = np.random.default_rng(2)
    cells = [
        cell_rows(*method.split(" + "), rng.uniform(1.0, 2.0, 3), disturbance=disturbance, noise=f"accel_mps2={sigma}")
        for disturbance in ("none", "bias")
        for method in METHODS
        for sigma in (0.1, 0.2)
    ]
    rows = pd.DataFrame([row for cell in cells for row in cell])
    palette = palette_of(rows)
    seen = {drawing.name: drawing.figure for drawing in of_rows(rows)}
    for kind in ("profile", "sensitivity"):
        for name, (colour, full) in drawn(seen[kind]).items():
            look = palette.look(method_of(name))
            assert (colour, full) == (look.colour.upper(), not look.dash), kind
    bars = [bar for axes in seen["bars"].axes for bar in axes.patches if np.isfinite(bar.get_height())]
    assert {(to_hex(bar.get_facecolor()).upper(), bar.get_hatch() or "") for bar in bars} == {
        (palette.look(method_of(name)).colour.upper(), palette.look(method_of(name)).hatch) for name in METHODS
    }
