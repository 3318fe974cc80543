"""Cells that are stopped half-way: their finished seeds are stored, and only the others run again."""

import pandas as pd
import pytest

from jerkbench.jobs import run as loop
from jerkbench.jobs.inputs import KEPT_INPUTS
from jerkbench.jobs.job import Protocol
from jerkbench.jobs.plan import planned
from jerkbench.jobs.rows import Result, Task, job_rows, work
from jerkbench.jobs.run import block_of, run_missing
from jerkbench.jobs.store import Store
from made_jobs import job_with
from stored_cells import write_blocks

SEEDS = 2 * KEPT_INPUTS + 3


def plan_of(seeds=SEEDS, **changed):
    return planned([job_with(Protocol(seeds=seeds, first_seed=4), **changed)])


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


@pytest.mark.parametrize(
    ("strict", "plan", "finished", "left"),
    [
        (False, plan_of(), 2, [*range(4 + 2 * KEPT_INPUTS, 4 + SEEDS)]),
        (True, plan_of(KEPT_INPUTS + 2), 1, [4 + KEPT_INPUTS, 5 + KEPT_INPUTS]),
        (False, plan_of(4, filter="gnss_only"), 3, [7]),  # its runs go alone
    ],
)
def test_an_interrupted_job_continues_with_the_seeds_that_are_missing(store, monkeypatch, strict, plan, finished, left):
    with monkeypatch.context() as patched:
        spied(patched, stop_after=finished)
        with pytest.raises(KeyboardInterrupt):
            run_missing(plan, store, strict=strict)
    ran = spied(monkeypatch)
    run_missing(plan, store, strict=strict)

    assert ran == [left]
    require_undisturbed(store, plan.jobs[0])


def test_a_damaged_block_and_a_failed_run_are_run_again(store):
    (job,) = plan_of(seeds=2 * KEPT_INPUTS).jobs
    first, second = (list(job.draws)[k : k + KEPT_INPUTS] for k in (0, KEPT_INPUTS))
    paths = []
    for draws in (first, second):
        (result,) = work(Task((job,), draws))
        write_blocks(store, [block_of(job, result)])
        paths += [path for path in store.folder.iterdir() if path not in paths]
    paths[1].write_bytes(paths[1].read_bytes()[:-40])

    assert sorted(store.known([job.key])[job.key]) == first
    failed = [{**row, "status": "failed"} for row in result.rows[:3]]
    write_blocks(store, [block_of(job, Result(failed, []))])
    assert sorted(store.known([job.key])[job.key]) == first
