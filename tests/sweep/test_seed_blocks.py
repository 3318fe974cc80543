"""Cells that are stopped half-way: their finished seeds are stored, and only the others run again."""

import pandas as pd
import pytest

from jerkbench.hydra_app.single_run import run_only_cell
from jerkbench.jobs.cell import Protocol, build
from jerkbench.jobs.inputs import KEPT
from jerkbench.jobs.rows import CellRun
from jerkbench.results.store import Store
from jerkbench.sweep import sweep, tasks
from jerkbench.sweep.sweep import plan_sweep, run_sweep, run_task
from jerkbench.sweep.tasks import Task

SEEDS = 2 * KEPT + 3
SPEC = {
    "dataset": {
        "name": "field",
        "duration_s": 8.0,
        "imu_rate_hz": 50.0,
        "reference_rate_hz": 50.0,
        "position_latency_s": 0.0,
    },
    "disturbance": [{"name": "none"}],
    "attitude": {"name": "tilt"},
    "filter": {"name": "jerk"},
    "adaptation": {"name": "none"},
    "engine": {"name": "compiled"},
}


def plan_of(seeds=SEEDS, **changed):
    return plan_sweep([build({**SPEC, **changed}, Protocol(seeds=seeds, first_seed=4))])


@pytest.fixture
def store(tmp_path):
    opened = Store(tmp_path)
    opened.prepare()
    return opened


def spied(monkeypatch, stop_after=None):
    """Record the seeds of each piece that is run; the piece after the last that is wanted is interrupted."""
    original, seen = sweep.pieces, []

    def pieces(*given):
        for ((rows, notes),) in original(*given):
            if stop_after is not None and len(seen) == stop_after:
                raise KeyboardInterrupt
            seen.append([row["seed"] for row in rows])
            yield [(rows, notes)]

    monkeypatch.setattr(sweep, "pieces", pieces)
    return seen


def require_undisturbed(store, planned):
    (stored,), broken = store.read([planned.key])
    rows, notes = CellRun(planned.cell, planned.fingerprint).rows()
    pd.testing.assert_frame_equal(stored.rows, pd.DataFrame(rows), check_exact=True)
    assert stored.metadata["notes"] == notes
    assert broken == []


def test_a_sweep_goes_on_within_a_cell(store, monkeypatch):
    plan = plan_of()
    with monkeypatch.context() as patched:
        spied(patched, stop_after=2)
        with pytest.raises(KeyboardInterrupt):
            run_sweep(plan, store)
    assert len(store.known(plan.draws)[plan.cells[0].key]) == 2 * KEPT

    ran = spied(monkeypatch)
    run_sweep(plan, store)

    assert ran == [[4 + 2 * KEPT, 5 + 2 * KEPT, 6 + 2 * KEPT]]
    require_undisturbed(store, plan.cells[0])


def test_a_single_run_goes_on_within_its_cell(tmp_path, monkeypatch):
    plan = plan_of(seeds=KEPT + 2)
    monkeypatch.setattr(sweep, "BUDGET_S", 0.0)
    with monkeypatch.context() as patched:
        spied(patched, stop_after=1)
        with pytest.raises(KeyboardInterrupt):
            run_only_cell(plan, tmp_path)

    ran = spied(monkeypatch)
    run_only_cell(plan, tmp_path)

    assert ran == [[4 + KEPT, 5 + KEPT]]
    require_undisturbed(Store(tmp_path), plan.cells[0])


def test_runs_that_go_alone_are_stored_one_after_the_other_where_they_take_long(store, monkeypatch):
    plan = plan_of(seeds=4, filter={"name": "gnss_only"})
    monkeypatch.setattr(sweep, "BUDGET_S", 0.0)
    with monkeypatch.context() as patched:
        spied(patched, stop_after=3)
        with pytest.raises(KeyboardInterrupt):
            run_sweep(plan, store)

    ran = spied(monkeypatch)
    run_sweep(plan, store)

    assert ran == [[7]]
    require_undisturbed(store, plan.cells[0])


def test_a_damaged_block_and_a_failed_run_are_run_again(store):
    (planned,) = plan_of(seeds=2 * KEPT).cells
    first, second = (list(planned.cell.draws)[k : k + KEPT] for k in (0, KEPT))
    paths = []
    for draws in (first, second):
        (result,) = run_task(Task((planned,), draws)).results
        store.write_blocks([tasks.block_of(planned, result)])
        paths += [path for path in store.folder.iterdir() if path not in paths]
    paths[1].write_bytes(paths[1].read_bytes()[:-40])

    assert sorted(store.known([planned.key])[planned.key]) == first
    failed = [{**row, "status": "failed"} for row in result.rows[:3]]
    store.write_blocks([tasks.block_of(planned, tasks.Result(failed, [], 0.0))])
    assert sorted(store.known([planned.key])[planned.key]) == first
