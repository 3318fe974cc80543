"""The size of a fault, read off labels; where methods cross, and what is noticed."""

import numpy as np
import pandas as pd
import pytest

from jerkbench.report.plots.sweeps import severity_figure
from jerkbench.report.sweeps import crossings, smallest_noticed, with_severity
from made_rows import cell_rows


def rows(sizes=(0.1, 1.0, 10.0), seeds=5):
    made = []
    for size in sizes:
        fault = f"bias+false_fix(offset_m={size:g}, length_s=5)"
        for adaptation, cost, acts in (("none", size, 0.0), ("chi2", 0.5 + 0.05 * size, 20.0 * (size > 0.5))):
            made += cell_rows("jerk", adaptation, [cost] * seeds, disturbance=fault, rejected_percent=acts)
    return pd.DataFrame(made).assign(rejected_percent=lambda made: made["rejected_percent"] + 0.1 * made["seed"])


def test_the_parameter_that_is_swept_is_the_size():
    swept = with_severity(rows())
    assert sorted(set(swept["severity"])) == [0.1, 1.0, 10.0]
    assert set(swept["severity_name"]) == {"offset_m"}
    assert set(swept["severity_of"]) == {"field: bias+false_fix(offset_m=..., length_s=5)"}


def test_two_sizes_are_no_sweep():
    assert with_severity(rows(sizes=(0.1, 1.0))).empty
    assert with_severity(rows().assign(disturbance="none")).empty


def test_a_sweep_stands_beside_what_is_none():
    both = pd.concat([rows(), rows().assign(disturbance="none")], ignore_index=True)
    assert len(with_severity(both)) == len(rows())


def test_methods_cross_where_their_lines_do():
    """log 1 to log 100 and a constant 10: half way."""
    sizes = np.array([0.0, 2.0, 4.0])
    (one,) = crossings(sizes, {"a": np.array([1.0, 100.0, 100.0]), "b": np.array([10.0, 10.0, np.nan])})
    assert one.size == pytest.approx(1.0)
    assert one.cost == pytest.approx(10.0)
    assert (one.better_below, one.better_above) == ("a", "b")
    (one,) = crossings(np.array([1.0, 100.0]), {"a": np.array([1.0, 100.0]), "b": np.array([10.0, 10.0])})
    assert one.size == pytest.approx(10.0)


def test_what_is_noticed_is_acted_on_from_there_on():
    swept = with_severity(rows())
    assert smallest_noticed(swept[swept["adaptation"] == "chi2"]) == 1.0
    assert np.isnan(smallest_noticed(swept[swept["adaptation"] == "none"]))
    assert np.isnan(smallest_noticed(swept.drop(columns="rejected_percent")))


def test_the_figure_has_a_line_for_each_method_and_marks_for_both():
    (axes,) = severity_figure(with_severity(rows()), "position_rmse_m").axes
    (line,) = [one for one in axes.get_lines() if one.get_label() == "jerk + none"]
    np.testing.assert_allclose(line.get_xdata(), [0.1, 1.0, 10.0])
    np.testing.assert_allclose(line.get_ydata(), [0.1, 1.0, 10.0])
    crossed = [one for one in axes.get_lines() if one.get_marker() == "x"]
    triangles = [one.get_xdata()[0] for one in axes.get_lines() if one.get_marker() == "^"]
    assert len(crossed) == 1
    assert 0.1 < crossed[0].get_xdata()[0] < 1.0
    assert triangles[1] == 1.0
