"""One colour a filter and one line style an adaptation, in every figure."""

import numpy as np
import pandas as pd
import pytest
from made_runs import make_estimate, make_recording
from matplotlib.colors import to_hex

from jerkbench.report.plots.runs import adapted_r_figure, error_figure, inclination_figure, trajectory_figure
from jerkbench.report.plots.studies import of_rows, palette_of
from jerkbench.report.plots.style import COLOURS, Palette, method_of

METHODS = ("jerk + mtf", "jerk + none", "bias + mtf", "bias + none")
STUDY = Palette.of(
    [("gnss_only", "none"), *((f, a) for f in ("baseline", "jerk", "bias") for a in ("none", "huber", "mtf"))]
)
PLAIN = {"-", "None"}


def figures(recording, estimates):
    given = recording, estimates
    return {
        "errors": error_figure(*given, palette=STUDY),
        "trajectory": trajectory_figure(*given, STUDY),
        "adapted-r": adapted_r_figure(*given, STUDY),
        "inclination": inclination_figure(*given, STUDY),
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
def test_every_figure_of_runs_draws_a_method_alike_whatever_else_is_in_it(chosen):
    blue = {"jerk": COLOURS[2], "bias": COLOURS[3]}
    estimates = {name: make_estimate(1.0, seed=METHODS.index(name)) for name in chosen}
    for kind, figure in figures(make_recording(), estimates).items():
        expected = {name: (blue[name[:4]].upper(), name.endswith("none")) for name in chosen}
        assert drawn(figure) == expected, kind


def test_every_figure_of_rows_draws_a_method_as_the_figures_of_runs_do(cell_rows):
    rng = np.random.default_rng(2)
    cells = [
        cell_rows(*method.split(" + "), rng.uniform(1.0, 2.0, 3), disturbance=disturbance, noise=f"accel_mps2={sigma}")
        for disturbance in ("none", "bias")
        for method in METHODS
        for sigma in (0.1, 0.2, 0.4)
    ]
    rows = pd.DataFrame([row for cell in cells for row in cell])
    palette = palette_of(rows)
    seen = {drawing.name: drawing.figure for drawing in of_rows(rows)}
    bars = [bar for axes in seen["bars"].axes for bar in axes.patches if np.isfinite(bar.get_height())]
    assert {(to_hex(bar.get_facecolor()).upper(), bar.get_hatch() or "") for bar in bars} == {
        (palette.style(method_of(name)).colour.upper(), palette.style(method_of(name)).hatch) for name in METHODS
    }
