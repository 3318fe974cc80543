"""Cells that are stopped half-way: their finished seeds are stored, and only the others run again."""

import pandas as pd
import pytest

from jerkbench.jobs import run as loop
from jerkbench.jobs.inputs import KEPT_INPUTS
from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.plan import planned
from jerkbench.jobs.rows import Result, Task, job_rows, work
from jerkbench.jobs.run import block_of, run_missing
from jerkbench.jobs.store import Store

SEEDS = 2 * KEPT_INPUTS + 3
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
    return planned([build({**SPEC, **changed}, Protocol(seeds=seeds, first_seed=4))])


@pytest.fixture
def store(tmp_path):
    opened = Store(tmp_path)
    opened.prepare()
    return opened


def spied(monkeypatch, stop_after=None):
    """Record the seeds of each piece that is run; the piece after the last that is wanted is interrupted."""
    original, seen = loop.work, []

    def work(task, **how):
        if stop_after is not None and len(seen) == stop_after:
            raise KeyboardInterrupt
        results = original(task, **how)
        seen.append([row["seed"] for row in results[0].rows])
        return results

    monkeypatch.setattr(loop, "work", work)
    return seen


def require_undisturbed(store, job):
    (stored,), broken = store.read([job.key])
    rows, notes = job_rows(job)
    pd.testing.assert_frame_equal(stored.rows, pd.DataFrame(rows), check_exact=True)
    assert stored.metadata["notes"] == notes
    assert broken == []


def test_a_sweep_goes_on_within_a_cell(store, monkeypatch):
    plan = plan_of()
    with monkeypatch.context() as patched:
        spied(patched, stop_after=2)
        with pytest.raises(KeyboardInterrupt):
            run_missing(plan, store)
    assert len(store.known(plan.draws)[plan.jobs[0].key]) == 2 * KEPT_INPUTS

    ran = spied(monkeypatch)
    run_missing(plan, store)

    assert ran == [[4 + 2 * KEPT_INPUTS, 5 + 2 * KEPT_INPUTS, 6 + 2 * KEPT_INPUTS]]
    require_undisturbed(store, plan.jobs[0])


def test_a_single_run_goes_on_within_its_cell(tmp_path, monkeypatch):
    plan = plan_of(seeds=KEPT_INPUTS + 2)
    with monkeypatch.context() as patched:
        spied(patched, stop_after=1)
        with pytest.raises(KeyboardInterrupt):
            run_missing(plan, Store(tmp_path), strict=True)

    ran = spied(monkeypatch)
    run_missing(plan, Store(tmp_path), strict=True)

    assert ran == [[4 + KEPT_INPUTS, 5 + KEPT_INPUTS]]
    require_undisturbed(Store(tmp_path), plan.jobs[0])


def test_runs_that_go_alone_are_stored_one_after_the_other_where_they_take_long(store, monkeypatch):
    plan = plan_of(seeds=4, filter={"name": "gnss_only"})
    with monkeypatch.context() as patched:
        spied(patched, stop_after=3)
        with pytest.raises(KeyboardInterrupt):
            run_missing(plan, store)

    ran = spied(monkeypatch)
    run_missing(plan, store)

    assert ran == [[7]]
    require_undisturbed(store, plan.jobs[0])


def test_a_damaged_block_and_a_failed_run_are_run_again(store):
    (job,) = plan_of(seeds=2 * KEPT_INPUTS).jobs
    first, second = (list(job.draws)[k : k + KEPT_INPUTS] for k in (0, KEPT_INPUTS))
    paths = []
    for draws in (first, second):
        (result,) = work(Task((job,), draws))
        store.write_blocks([block_of(job, result)])
        paths += [path for path in store.folder.iterdir() if path not in paths]
    paths[1].write_bytes(paths[1].read_bytes()[:-40])

    assert sorted(store.known([job.key])[job.key]) == first
    failed = [{**row, "status": "failed"} for row in result.rows[:3]]
    store.write_blocks([block_of(job, Result(failed, []))])
    assert sorted(store.known([job.key])[job.key]) == first
