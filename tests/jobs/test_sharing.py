"""Two sweeps in one folder: no cell is run twice, none is missing."""

import threading

import pytest

from commands import PATIENCE_S
from jerkbench.jobs import plan as planning
from jerkbench.jobs import rows as rows_module
from jerkbench.jobs import run as loop
from jerkbench.jobs.inputs import KEPT_INPUTS
from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.labels import Labels
from jerkbench.jobs.plan import planned
from jerkbench.jobs.rows import Result, job_rows
from jerkbench.jobs.run import KnownSeeds, Locks, Shared, Writer, block_of, run_missing
from jerkbench.jobs.store import Store


def cell(duration_s, seeds):
    return build(
        {
            "dataset": {
                "name": "field",
                "duration_s": duration_s,
                "imu_rate_hz": 20.0,
                "reference_rate_hz": 20.0,
                "position_latency_s": 0.0,
            },
            "disturbance": [{"name": "none"}],
            "attitude": {"name": "gyro_only"},
            "filter": {"name": "gnss_only"},
            "adaptation": {"name": "none"},
            "engine": {"name": "filterpy"},
        },
        Protocol(seeds=seeds, burn_in_s=0.0),
        Labels(f"field({duration_s:g})", "none", "gyro_only", "gnss_only", "none", "default"),
    )


@pytest.mark.parametrize(("durations", "seeds"), [(range(4, 10), 1), (range(4, 6), KEPT_INPUTS + 2)])
def test_two_sweeps_share_their_cells(durations, seeds, tmp_path, monkeypatch):
    """Each waits in its first run until the other has come to its own: both are at work."""
    monkeypatch.setattr(planning, "BUNDLES", 3)
    monkeypatch.setattr(loop, "POLL_S", 0.02)
    monkeypatch.setattr(rows_module, "BUDGET_S", PATIENCE_S)  # on a slow machine, too, a task is one piece
    plan = planned([cell(float(duration), seeds) for duration in durations])
    original, ran, both, met = loop.work, [], threading.Barrier(2, timeout=PATIENCE_S), set()

    def work(task, **how):
        if threading.get_ident() not in met:
            met.add(threading.get_ident())
            both.wait()
        ran.extend((job.labels.dataset, tuple(task.draws)) for job in task.jobs)
        return original(task, **how)

    monkeypatch.setattr(loop, "work", work)
    store = Store(tmp_path)
    store.prepare()
    sweeps = [threading.Thread(target=run_missing, args=(plan, store)) for _ in range(2)]
    for thread in sweeps:
        thread.start()
    for thread in sweeps:
        thread.join(PATIENCE_S)

    assert len(met) == 2
    assert len(ran) == len(set(ran)) == len(durations) * (1 if seeds == 1 else 2)
    assert store.known(plan.draws) == {key: set(draws) for key, draws in plan.draws.items()}
    assert not (tmp_path / ".locks").exists()


def test_a_bundle_is_anybodys_when_its_rows_are_stored_whatever_else_waits(tmp_path, monkeypatch):
    """Of two jobs in a task, with the clock in hand: what is held is stored after a while, and bundles with it."""
    now = [0.0]
    monkeypatch.setattr(loop.time, "monotonic", lambda: now[0])
    plan = planned([cell(4.0, 1), cell(5.0, 1), cell(6.0, 1)])
    tasks = [group[0]._replace(bundle=number) for number, group in enumerate(planning.grouped(plan.jobs))]
    store = Store(tmp_path)
    store.prepare()
    known = KnownSeeds(store, plan.jobs)

    def free(bundle):
        with Locks(tmp_path / ".locks", "plan") as others:
            return others.take(bundle)

    def done(task, shared, writer):
        for job in task.jobs:
            (row,), notes = job_rows(job)
            writer.add([job], [Result([row], notes)])
        shared.settle(task.bundle, task.runs)

    with Locks(tmp_path / ".locks", "plan") as locks, Writer(store, known) as writer:
        shared = Shared([[task] for task in tasks], known, locks, writer)
        assert [shared.admitted([task]) for task in tasks] == [[task] for task in tasks]
        done(tasks[0], shared, writer)
        assert not store.known(plan.draws)
        assert not free(0)
        now[0] += 2 * loop.HELD_S
        done(tasks[1], shared, writer)
        assert len(store.known(plan.draws)) == 2
        assert free(0)
        assert free(1)
        done(tasks[2], shared, writer)
        assert not free(2)
        writer.flush()
        assert free(2)
        monkeypatch.setattr(store, "load", lambda *_: pytest.fail("it reads what it has written"))
        assert not known.unfinished(plan.jobs)


def test_results_wait_for_a_second_and_later_for_a_tenth_of_the_time_so_far_up_to_five(tmp_path, monkeypatch):
    now = [0.0]
    monkeypatch.setattr(loop.time, "monotonic", lambda: now[0])
    with Writer(Store(tmp_path), KnownSeeds(Store(tmp_path), [])) as writer:
        for seconds, wanted in ((0.0, 1.0), (9.0, 1.0), (30.0, 3.0), (1000.0, 5.0)):
            now[0] = seconds
            assert writer.held_s == pytest.approx(wanted)


def test_what_another_process_has_stored_meanwhile_is_left_out(tmp_path):
    plan = planned([cell(4.0, 1), cell(5.0, 1)])
    groups = planning.grouped(plan.jobs)
    store = Store(tmp_path)
    store.prepare()
    known = KnownSeeds(store, plan.jobs)
    with Locks(tmp_path / ".locks", "plan") as locks, Writer(store, known) as writer:
        shared = Shared(groups, known, locks, writer)
        job = plan.jobs[0]
        (row,), notes = job_rows(job)
        Store(tmp_path).write_blocks([block_of(job, Result([row], notes))])

        assert [shared.admitted(group) for group in groups] == [[], groups[1]]
