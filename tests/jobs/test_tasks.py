"""Cells with many seeds run in pieces, and are whole again afterwards."""

import pickle
from concurrent.futures import Executor, Future
from contextlib import nullcontext
from dataclasses import replace

import pandas as pd
import pyarrow as pa
import pytest

from jerkbench.arrays import WIDE
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.filters.kinematic import Jerk
from jerkbench.jobs import rows as rows_module
from jerkbench.jobs import run as loop
from jerkbench.jobs.cluster import Lent, Workers
from jerkbench.jobs.dispatch import TRIES
from jerkbench.jobs.inputs import KEPT_INPUTS
from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.plan import Plan, grouped, planned
from jerkbench.jobs.rows import Task, job_rows, work
from jerkbench.jobs.run import origin, run_missing, sent
from jerkbench.jobs.store import Store
from made_jobs import with_method

SEEDS = KEPT_INPUTS + 3


def cell(adaptation, **dataset):
    return build(
        {
            "dataset": {
                "name": "field",
                "duration_s": 8.0,
                "imu_rate_hz": 50.0,
                "reference_rate_hz": 50.0,
                "position_latency_s": 0.0,
                **dataset,
            },
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
    return planned([cell("none"), cell("mtf")])


def test_the_pieces_of_a_group_share_their_seeds(plan):
    groups = grouped(plan.jobs)

    assert [[(task.jobs[0].labels.adaptation, task.draws) for task in group] for group in groups] == [
        [("none", range(4, 4 + KEPT_INPUTS)), ("mtf", range(4, 4 + KEPT_INPUTS))],
        [("none", range(4 + KEPT_INPUTS, 4 + SEEDS)), ("mtf", range(4 + KEPT_INPUTS, 4 + SEEDS))],
    ]


@pytest.mark.parametrize("packed_rows", [1, KEPT_INPUTS, SEEDS])
def test_a_cell_in_pieces_has_the_rows_of_the_whole_one(plan, packed_rows, tmp_path, monkeypatch):
    """All its pieces come as tables, those with many rows do, or none."""
    monkeypatch.setattr(loop, "PACKED_ROWS", packed_rows)
    store = Store(tmp_path)
    store.prepare()

    run_missing(plan, store, Workers(Fragile(lambda _: False)))

    for one in plan.jobs:
        (stored,), _ = store.read([one.key])
        rows, notes = job_rows(one)
        pd.testing.assert_frame_equal(stored.rows, pd.DataFrame(rows), check_exact=True)
        assert stored.metadata["notes"] == notes


def test_settings_that_share_their_calls_come_as_tables_from_processes(tmp_path):
    """Beside the few rows of another job."""
    told = [{"accel_mps2": 1.0 + k} for k in range(6)]
    jobs = [replace(cell("mtf").at({"filter": own}), draws=range(4, 28)) for own in told]
    plan = Plan((*jobs, replace(cell("none"), draws=range(4, 6))))
    store = Store(tmp_path)
    store.prepare()
    assert len(jobs) * 24 >= loop.PACKED_ROWS

    with Workers(count=2) as workers:
        run_missing(plan, store, workers, least=len(jobs))

    for one in plan.jobs:
        (stored,), _ = store.read([one.key])
        pd.testing.assert_frame_equal(stored.rows, pd.DataFrame(job_rows(one)[0]), check_exact=True)


def test_many_rows_come_as_the_table_that_is_stored_and_few_as_rows(plan, monkeypatch):
    task = Task((plan.jobs[0],), range(4, 6))
    few, _, none = sent(task, {"commit": "abc"})
    monkeypatch.setattr(loop, "PACKED_ROWS", 2)
    (many,), _, stream = sent(task, {**origin(), "commit": "abc"})
    table = pa.ipc.open_stream(stream).read_all()

    assert none is None
    assert table["position_rmse_m"].to_pylist() == [row["position_rmse_m"] for row in few[0].rows]
    assert set(table["cell.commit"].to_pylist()) == {'"abc"'}
    assert many.rows == [{"seed": 4, "status": "ok"}, {"seed": 5, "status": "ok"}]


class Fragile(Executor):
    """A cluster without processes, on which some tasks lose their worker.

    Attributes:
        dies: whether a task does.
        sizes: how many cells each had.
    """

    def __init__(self, dies):
        self.dies, self.sizes = dies, []

    def open(self, workers):
        return nullcontext(Lent(self, lambda: 1))

    def submit(self, run, pack):
        (task,) = pickle.loads(pack.content)[1]  # noqa: S301 - packed by this test
        self.sizes.append(len(task.jobs))
        future = Future()
        if self.dies(task):
            future.set_exception(ChildProcessError("it died"))
        else:
            future.set_result(run(pack))
        return future


def test_a_piece_that_is_lost_is_a_piece_of_failed_rows_and_runs_again(plan, tmp_path):
    store, lost = Store(tmp_path), plan.jobs[0]
    store.prepare()

    run_missing(plan, store, Workers(Fragile(lambda task: task.jobs[0].key == lost.key and task.draws[0] != 4)))
    (stored,), _ = store.read([lost.key])
    assert list(stored.rows["seed"]) == list(range(4, 4 + SEEDS))
    assert list(stored.rows["status"]) == ["ok"] * KEPT_INPUTS + ["failed"] * 3
    assert set(stored.rows["reason"][KEPT_INPUTS:]) == {"ChildProcessError: the process that ran it died (it died)"}
    assert len(store.known([lost.key])[lost.key]) == KEPT_INPUTS

    run_missing(plan, store)
    (again,), _ = store.read([lost.key])
    pd.testing.assert_frame_equal(again.rows, pd.DataFrame(job_rows(lost)[0]), check_exact=True)


def settings(adaptation, count):
    first = replace(cell(adaptation), draws=range(4, 6))
    return [with_method(first, filter=Jerk(accel_mps2=1.0 + k)) for k in range(count)]


def named(task):
    return [(job.labels.adaptation, job.method.filter.accel_mps2) for job in task.jobs]


def test_settings_of_a_method_share_a_call_wherever_the_plan_has_them():
    turns = [job for pair in zip(settings("none", 3), settings("mtf", 3), strict=True) for job in pair]

    (tasks,) = grouped(turns, least=3)

    assert list(map(named, tasks)) == [[(name, 1.0 + k) for k in range(3)] for name in ("none", "mtf")]


def test_a_call_is_cut_into_whole_vectors_and_only_where_it_fits_no_bundle():
    jobs = [*settings("none", 5), *settings("mtf", 2 * WIDE + 3)]

    (tasks,) = grouped(jobs, least=WIDE + 2)

    assert [(task.bundle, len(task.jobs)) for task in tasks] == [(0, 5), (1, WIDE), (2, WIDE), (3, 3)]


def test_jobs_of_other_seeds_meet_no_recording_of_each_other():
    jobs = [replace(job, draws=range(4 + 2 * k, 6 + 2 * k)) for k in range(2) for job in settings("none", 2)]

    groups = grouped(jobs, least=4)

    assert [[(len(task.jobs), task.draws) for task in group] for group in groups] == [
        [(2, range(4, 6))],
        [(2, range(6, 8))],
    ]


def test_a_task_whose_time_is_up_comes_back_with_its_rest(plan, monkeypatch):
    monkeypatch.setattr(rows_module, "BUDGET_S", 0.0)
    alone = replace(with_method(plan.jobs[0], engine=FilterpyEngine()), draws=range(4, 7))
    task = grouped([alone])[0][0]

    done = work(task)

    assert [len(result.rows) for result in done.results] == [1]
    assert list(done.rest.draws) == [5, 6]
    assert work(done.rest._replace(draws=[6])).rest is None


def test_the_bundles_of_a_plan_are_the_same_whatever_is_left_of_it(plan, monkeypatch):
    monkeypatch.setattr("jerkbench.jobs.plan.BUNDLES", 2)
    whole = [task for group in grouped(plan.jobs) for task in group]
    of = {(one.key, task.draws[0]): task.bundle for task in whole for one in task.jobs}
    half = grouped(plan.jobs, {job.key: job.draws for job in plan.jobs[1:]})

    assert sorted(of.values()) == [0, 0, 1, 1]
    assert [([one.key for one in task.jobs], task.bundle) for group in half for task in group] == [
        ([plan.jobs[1].key], 0),
        ([plan.jobs[1].key], 1),
    ]


def test_of_cells_that_share_their_calls_the_one_that_ends_its_process_is_told_apart(tmp_path):
    base = cell("none")
    told = [{"accel_mps2": accel} for accel in (0.1, 0.2, 0.4)]
    plan = Plan(tuple(replace(base.at({"filter": own}), draws=range(4)) for own in told))
    store = Store(tmp_path)
    bad = plan.jobs[1].key
    cluster = Fragile(lambda task: bad in [one.key for one in task.jobs])

    run_missing(plan, store, Workers(cluster), least=8)

    assert cluster.sizes == [3] + [1] * (2 + TRIES - 1)  # the first loss was its too
    rows = store.rows(plan.jobs, ["position_rmse_m"])
    assert list(rows["status"]) == ["ok"] * 4 + ["failed"] * 4 + ["ok"] * 4
    alone = [row["position_rmse_m"] for row in job_rows(plan.jobs[2])[0]]
    assert list(rows["position_rmse_m"][8:]) == alone
