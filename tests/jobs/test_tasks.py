"""Jobs with many seeds run in chunks, and are complete again afterwards."""

import pickle
from concurrent.futures import Executor, Future
from contextlib import nullcontext
from dataclasses import replace

import pandas as pd
import pytest

from jerkbench.filters.kinematic import Jerk
from jerkbench.jobs.executors import Pool, Workers
from jerkbench.jobs.job import Protocol
from jerkbench.jobs.plan import Plan, chunks_of, planned
from jerkbench.jobs.rows import MAX_CACHED_INPUTS, job_rows
from jerkbench.jobs.run import MAX_DEATHS, run_missing
from jerkbench.jobs.store import Store
from made_jobs import job_with, with_method

SEEDS = MAX_CACHED_INPUTS + 3


def cell(adaptation, seeds=SEEDS):
    return job_with(Protocol(seeds=seeds, first_seed=4), adaptation=adaptation)


@pytest.fixture
def plan():
    return planned([cell("none"), cell("mtf")])


def settings(adaptation, count):
    first = replace(cell(adaptation), draws=range(4, 6))
    return [with_method(first, filter=Jerk(accel_mps2=1.0 + k)) for k in range(count)]


def all_seeds(jobs):
    return {job.key: set(job.draws) for job in jobs}


def runs(chunks):
    return sorted((job.key, draw) for chunk in chunks for task in chunk for job in task.jobs for draw in task.draws)


@pytest.mark.parametrize("workers", [1, 2, 5, 64])
@pytest.mark.parametrize("seeds", [1, 3, SEEDS, 200])
def test_every_run_is_in_one_chunk_and_every_worker_has_work(seeds, workers):
    jobs = [cell(name, seeds) for name in ("none", "mtf", "huber")]
    chunks = chunks_of(jobs, all_seeds(jobs), workers)

    assert runs(chunks) == sorted((job.key, draw) for job in jobs for draw in job.draws)
    assert len(chunks) >= min(workers, 3 * seeds) / 2
    sharing = settings("none", 64)  # one call
    grid = chunks_of(sharing, all_seeds(sharing), workers)
    assert len(grid) >= min(workers, 64)
    for chunk in chunks:
        assert len({draw for task in chunk for draw in task.draws}) <= MAX_CACHED_INPUTS


class Fragile(Executor):
    """A cluster without processes, on which tasks that ``dies`` chooses lose their worker."""

    def __init__(self, dies=lambda task: False):
        self.dies, self.sizes = dies, []

    def open(self, workers):
        return nullcontext(Pool(self, lambda: 1))

    def submit(self, run, content, *rest):
        tasks = pickle.loads(content)[1]  # noqa: S301 - packed by this test
        self.sizes.append(sum(len(task.jobs) for task in tasks))
        future = Future()
        if any(map(self.dies, tasks)):
            future.set_exception(ChildProcessError("it died"))
        else:
            future.set_result(run(content, *rest))
        return future


def test_rows_of_an_executor_are_those_of_this_process(plan, tmp_path):
    run_missing(plan, Store(tmp_path), Workers(Fragile(), 2))

    for one in plan.jobs:
        (stored,), _ = Store(tmp_path).read([one.key])
        rows, notes = job_rows(one)
        pd.testing.assert_frame_equal(stored.rows, pd.DataFrame(rows), check_exact=True)
        assert stored.metadata["notes"] == notes


def test_a_task_whose_workers_die_has_failed_rows_and_runs_again_in_the_next_sweep(plan, tmp_path):
    store, first = Store(tmp_path), plan.jobs[0]
    run_missing(plan, store, Workers(Fragile(lambda task: task.jobs[0].key == first.key and task.draws[0] != 4)))
    (stored,), _ = store.read([first.key])

    assert list(stored.rows["seed"]) == list(range(4, 4 + SEEDS))
    assert list(stored.rows["status"]) == ["ok"] * MAX_CACHED_INPUTS + ["failed"] * 3
    assert set(stored.rows["reason"][MAX_CACHED_INPUTS:]) == {"ChildProcessError: its worker process died (it died)"}

    run_missing(plan, store)
    (again,), _ = store.read([first.key])
    pd.testing.assert_frame_equal(again.rows, pd.DataFrame(job_rows(first)[0]), check_exact=True)


def test_the_job_that_ends_its_worker_is_found_among_those_of_its_call(tmp_path):
    base = cell("none")
    jobs = [replace(base.at({"filter": {"accel_mps2": accel}}), draws=range(4)) for accel in (0.1, 0.2, 0.4)]
    store, bad = Store(tmp_path), jobs[1].key
    cluster = Fragile(lambda task: bad in [one.key for one in task.jobs])

    run_missing(Plan(tuple(jobs)), store, Workers(cluster))

    assert cluster.sizes == [3] * (MAX_DEATHS - 1) + [1] * 3
    rows = store.rows(jobs, ["position_rmse_m"])
    assert list(rows["status"]) == ["ok"] * 4 + ["failed"] * 4 + ["ok"] * 4
    assert list(rows["position_rmse_m"][8:]) == [row["position_rmse_m"] for row in job_rows(jobs[2])[0]]
