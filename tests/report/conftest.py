"""Rows of runs, as a sweep stores them."""

import pandas as pd
import pytest

import made_rows
from jerkbench.evaluation.judgement import Judgement


@pytest.fixture
def judgement():
    def make(verdict, ratio, low, high, lost=(0, 0), n=20):
        return Judgement(ratio, low, high, n, 0.5, 0.5, lost, (0, 0), any(lost), 3.0, verdict, "")

    return make


@pytest.fixture
def cell_rows():
    return made_rows.cell_rows


@pytest.fixture
def rows(cell_rows):
    """Two filters with two adaptations; one combination is missing, in one four of eight runs diverged."""
    cells = [
        *cell_rows("jerk", "none", 2 * [0.011, 0.012, 0.014, 0.013], anees=4.0),
        *cell_rows("jerk", "sage_husa", 2 * [0.021, 0.022, 0.024, 0.023], anees=5.0),
        *cell_rows("baseline", "none", 4 * [0.031] + 4 * [9.0], anees=6.0),
    ]
    for run in cells[-4:]:
        run.update(status="diverged", reason="The position error is 4000 m at 3.00 s; the limit is 1000 m.")
    return pd.DataFrame(cells)
