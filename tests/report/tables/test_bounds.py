"""The bound of each scenario in the table of the position RMSE."""

import math

import numpy as np
import pandas as pd
import pytest

from jerkbench.report.summary import summarise
from jerkbench.report.writers import markdown


@pytest.fixture
def bounded(cell_rows):
    """Two scenarios, a bound for the first alone; of a filter one run diverged early, with a bound of its own."""
    rows = []
    for disturbance, bounds in (("none", [0.007, 0.008, 0.009]), ("bias", [math.nan] * 3)):
        for name in ("jerk", "baseline"):
            for adaptation in ("none", "mtf"):
                cell = cell_rows(name, adaptation, [0.011, 0.012, 0.013], disturbance=disturbance)
                rows += [run | {"position_bound_m": bound} for run, bound in zip(cell, bounds, strict=True)]
    rows[0] |= {"status": "diverged", "position_bound_m": 0.001}
    return pd.DataFrame(rows)


def test_it_is_a_row_below_the_filters_of_its_scenario(bounded):
    table = summarise(bounded, "position_rmse_m")
    assert table.row_keys == ("disturbance", "filter")
    assert table.rows == (
        *(("none", "jerk"), ("none", "baseline"), ("none", "bound")),
        *(("bias", "jerk"), ("bias", "baseline")),
    )
    value = np.sqrt(np.mean(np.square([0.007, 0.008, 0.009])))
    assert [cell.mean for cell in table.cells[2]] == pytest.approx([value, value])
    assert not any(cell.best for cell in table.cells[2])
    assert [cell.text for cell in table.cells[2]] == ["0.00804", "0.00804"]
    assert "| bound | 0.00804 | 0.00804 |" in " ".join(markdown(table).split())


def test_what_it_is_and_where_there_is_none_is_said(bounded):
    (note,) = [note for note in summarise(bounded, "position_rmse_m").footnotes if "Cramér-Rao" in note]
    assert note.endswith("0.00804 (field, none), not known for 1 of 2 scenarios.")
    unknown = summarise(bounded.assign(position_bound_m=np.nan), "position_rmse_m")
    assert not any("bound" in row for row in unknown.rows)
    assert any(note.endswith("not known for 2 of 2 scenarios.") for note in unknown.footnotes)


def test_other_tables_have_none(bounded):
    without = summarise(bounded.drop(columns="position_bound_m"), "position_rmse_m")
    across = summarise(bounded, "position_rmse_m", column_keys=["disturbance"])
    own = summarise(bounded, "position_bound_m")
    for table in (without, across, own):
        assert not any("bound" in row for row in table.rows)
    assert not any("Cramér" in note for note in (*without.footnotes, *own.footnotes))
    assert any("Cramér" in note for note in across.footnotes)
    assert not any(cell.best for row in own.cells for cell in row)
