"""The figure of mean ranks against scikit-posthocs: a line joins whom Nemenyi's test does not tell apart."""

import itertools

import numpy as np
import pandas as pd
import pytest

from jerkbench.evaluation.ranks import critical_difference
from jerkbench.report.drawings import of_rows
from jerkbench.report.plots.bars import RANKED, critical_difference_figure
from jerkbench.report.plots.style import MethodStyle

FULL, DASHED = MethodStyle("#112233", (), ""), MethodStyle("#445566", (8, 4), "////")


def drawn(ranks, least):
    """Rows (first, last) of each line that joins methods, and the places of the dots."""
    names = [f"m{k}" for k in range(len(ranks))]
    figure = critical_difference_figure(ranks, least, names, [FULL, *[DASHED] * (len(names) - 1)], "RMSE [m]", 12)
    (axes,) = figure.axes
    joins = [line for line in axes.get_lines() if line.get_linewidth() == 2.2]
    dots = [line for line in axes.get_lines() if line.get_marker() == "o"]
    rows = [(round(line.get_ydata()[0] + 0.3), round(line.get_ydata()[1] - 0.3)) for line in joins]
    return rows, dots, axes


def test_a_line_joins_whom_nemenyi_does_not_tell_apart():
    posthocs = pytest.importorskip("scikit_posthocs")
    costs = np.random.default_rng(3).normal(size=(12, 7)) + np.linspace(0, 2.5, 7)
    ranks = pd.DataFrame(costs).rank(axis=1).mean().to_numpy()
    order = np.argsort(ranks)
    p = posthocs.posthoc_nemenyi_friedman(costs).to_numpy()[np.ix_(order, order)]
    rows, dots, _ = drawn(ranks, critical_difference(7, 12))
    joined = {pair for first, last in rows for pair in itertools.combinations(range(first, last + 1), 2)}
    assert joined == {pair for pair in itertools.combinations(range(7), 2) if p[pair] > 0.05}
    assert 0 < len(joined) < 21
    assert [dot.get_xdata()[0] for dot in dots] == sorted(ranks)


def test_who_has_an_adaptation_is_hollow_and_the_worst_of_many_are_not_drawn():
    _, dots, axes = drawn(np.arange(1.0, 31.0), 3.0)
    assert len(dots) == RANKED
    assert dots[0].get_markerfacecolor() == FULL.colour
    assert {dot.get_markerfacecolor() for dot in dots[1:]} == {"white"}
    assert "6 worse ones are not drawn" in axes.get_xlabel()
    assert axes.get_yticklabels()[0].get_text() == "m0  1.0"


def test_a_study_of_several_scenarios_has_the_figure_and_of_one_it_has_not(cell_rows):
    sizes = {("jerk", "none"): 1.0, ("jerk", "mtf"): 2.0, ("baseline", "none"): 3.0}
    made = [
        pd.DataFrame(cell_rows(*method, [size, 1.1 * size], disturbance=scenario))
        for scenario in ("none", "bias")
        for method, size in sizes.items()
    ]
    both = {one.name: one for one in of_rows(pd.concat(made, ignore_index=True))}
    labels = [label.get_text() for label in both["critical-difference"].figure.axes[0].get_yticklabels()]
    assert labels == ["jerk+none  1.0", "jerk+mtf  2.0", "baseline+none  3.0"]
    assert "critical-difference" not in {one.name for one in of_rows(pd.concat(made[:3], ignore_index=True))}
