"""Cells with many seeds run in pieces, and are whole again afterwards."""

import pandas as pd
import pytest

from jerkbench.cells.cell import Protocol, build
from jerkbench.execution.cell_run import CellRun
from jerkbench.execution.inputs import KEPT
from jerkbench.results.store import Store
from jerkbench.sweep.sweep import Finished, plan_sweep, run_sweep, run_task
from jerkbench.sweep.tasks import grouped

SEEDS = KEPT + 3


def cell(adaptation, **dataset):
    return build(
        {
            "dataset": {"name": "field", "duration_s": 8.0, "imu_rate_hz": 50.0, "reference_rate_hz": 50.0, **dataset},
            "disturbance": [{"name": "none"}],
            "attitude": {"name": "tilt"},
            "filter": {"name": "jerk"},
            "adaptation": {"name": adaptation},
            "engine": {"name": "compiled"},
        },
        Protocol(seeds=SEEDS, first_seed=4),
    )


@pytest.fixture
def plan():
    return plan_sweep([cell("none"), cell("mtf")])


def test_the_pieces_of_a_group_share_their_seeds(plan):
    groups = grouped(plan.cells)

    assert [[(task.planned.cell.labels.adaptation, task.draws) for task in group] for group in groups] == [
        [("none", range(4, 4 + KEPT)), ("mtf", range(4, 4 + KEPT))],
        [("none", range(4 + KEPT, 4 + SEEDS)), ("mtf", range(4 + KEPT, 4 + SEEDS))],
    ]


def test_a_cell_in_pieces_has_the_rows_of_the_whole_one(plan, tmp_path):
    store = Store(tmp_path)
    store.prepare()

    run_sweep(plan, store, workers=1, done=())

    for one in plan.cells:
        (stored,), _ = store.read([one.key])
        rows, notes = CellRun(one.cell, one.fingerprint).rows()
        pd.testing.assert_frame_equal(stored.rows, pd.DataFrame(rows), check_exact=True)
        assert stored.metadata["notes"] == notes


def test_a_piece_that_is_lost_is_a_piece_of_failed_rows(plan, tmp_path):
    store, one = Store(tmp_path), plan.cells[0]
    store.prepare()
    finished = Finished(store)
    first, last = (task for group in grouped(plan.cells) for task in group if task.planned is one)

    assert finished.add(last, ChildProcessError("it died")) == []
    assert not store.path(one.key).exists()
    statuses = finished.add(first, run_task(tmp_path, first))

    assert statuses == ["ok"] * KEPT + ["failed"] * 3
    (stored,), _ = store.read([one.key])
    assert list(stored.rows["seed"]) == list(range(4, 4 + SEEDS))
