"""Two sweeps in one folder: no cell is run twice, none is missing."""

import threading

import pytest

from commands import PATIENCE_S
from jerkbench.jobs.cell import Labels, Protocol, build
from jerkbench.jobs.inputs import KEPT
from jerkbench.jobs.rows import CellRun
from jerkbench.results.store import Store
from jerkbench.sweep import sweep, tasks
from jerkbench.sweep.locks import Locks, Shared
from jerkbench.sweep.sweep import plan_sweep, run_sweep
from jerkbench.sweep.tasks import Writer, block_of


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


@pytest.mark.parametrize(("durations", "seeds"), [(range(4, 10), 1), (range(4, 6), KEPT + 2)])
def test_two_sweeps_share_their_cells(durations, seeds, tmp_path, monkeypatch):
    """Each waits in its first run until the other has come to its own: both are at work."""
    monkeypatch.setattr(tasks, "BUNDLES", 3)
    monkeypatch.setattr(sweep, "POLL_S", 0.02)
    plan = plan_sweep([cell(float(duration), seeds) for duration in durations])
    original, ran, both, met = sweep.pieces, [], threading.Barrier(2, timeout=PATIENCE_S), set()

    def pieces(runs, draws):
        if threading.get_ident() not in met:
            met.add(threading.get_ident())
            both.wait()
        ran.extend((run.cell.labels.dataset, tuple(draws)) for run in runs)
        yield from original(runs, draws)

    monkeypatch.setattr(sweep, "pieces", pieces)
    store = Store(tmp_path)
    store.prepare()
    sweeps = [threading.Thread(target=run_sweep, args=(plan, store)) for _ in range(2)]
    for thread in sweeps:
        thread.start()
    for thread in sweeps:
        thread.join(PATIENCE_S)

    assert len(met) == 2
    assert len(ran) == len(set(ran)) == len(durations) * (1 if seeds == 1 else 2)
    assert store.known(plan.draws) == {key: set(draws) for key, draws in plan.draws.items()}
    assert not (tmp_path / ".locks").exists()


def test_what_another_process_has_stored_meanwhile_is_left_out(tmp_path):
    plan = plan_sweep([cell(4.0, 1), cell(5.0, 1)])
    groups = tasks.grouped(plan.cells)
    store = Store(tmp_path)
    store.prepare()
    with Locks(tmp_path / ".locks", "plan") as locks, Writer(store) as writer:
        shared = Shared(locks, writer, groups, set())
        planned = plan.cells[0]
        (row,), notes = CellRun(planned.cell, planned.fingerprint).rows()
        Store(tmp_path).write_blocks([block_of(planned, tasks.Result([row], notes, 0.1))])

        assert [shared.admitted(group) for group in groups] == [[], groups[1]]
