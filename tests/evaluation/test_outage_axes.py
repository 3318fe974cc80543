"""Horizontal and vertical errors inside outages against a naive loop."""

import math

import numpy as np
import pytest

from jerkbench.evaluation.counted_rows import counted_rows
from jerkbench.evaluation.metrics.recovery import OutageAxes


def test_the_axes_are_the_naive_loop(estimate, recording):
    counted = counted_rows(estimate, recording, 5.0)
    squares = []
    for row, position, count in zip(estimate.index, estimate.position_m, counted, strict=True):
        t, truth = recording.reference.t_s[row], recording.reference.enu_m[row]
        if count and not np.isnan(truth).any() and any(begin <= t < end for begin, end in recording.outages_s):
            squares.append([(a - b) ** 2 for a, b in zip(position, truth, strict=True)])
    east, north, up = (sum(axis) / len(squares) for axis in zip(*squares, strict=True))

    assert 5 < len(squares) < 14
    assert OutageAxes().evaluate(estimate, recording, counted) == pytest.approx(
        {"outage_rmse_horizontal_m": math.sqrt(east + north), "outage_rmse_up_m": math.sqrt(up)}
    )


def test_without_a_row_there_is_no_value(estimate, recording):
    values = OutageAxes().evaluate(estimate, recording, np.zeros(len(estimate.index), dtype=bool))
    assert all(math.isnan(value) for value in values.values())
