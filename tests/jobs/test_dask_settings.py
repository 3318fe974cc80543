"""Dask's workers are not watched while they run: settings that the processes have for which they are."""

import re
import subprocess
import sys

import pytest

import pages
from commands import PATIENCE_S, environment
from jerkbench.jobs import dask_cluster
from jerkbench.jobs.dask_cluster import SPARING, Dask, JobQueue, Slots, exports

dask = pytest.importorskip("dask")
pytest.importorskip("distributed")


def periods_ms(dask_worker):
    """What a worker does periodically, with the time between [ms]."""
    return {name: callback.callback_time for name, callback in dask_worker.periodic_callbacks.items()}


def test_a_worker_that_is_started_here_is_not_watched_while_it_runs():
    before = dask.config.get("distributed.admin.tick.interval")
    with Dask().open(1) as lent:
        (periods,) = lent.executor._client.run(periods_ms).values()

    assert "profile" not in periods
    assert {name: periods[name] for name in ("tick", "monitor")} == {"tick": 1000.0, "monitor": 10_000.0}
    assert min(periods.values()) >= 500.0  # a heartbeat
    assert dask.config.get("distributed.admin.tick.interval") == before


def test_dask_understands_what_a_job_exports():
    named = dict(re.fullmatch(r"export (\w+)=(\S+)", line).groups() for line in exports())
    script = "import dask, distributed; print([dask.config.get(name) for name in %r])" % list(SPARING)  # noqa: UP031
    told = subprocess.run(
        [sys.executable, "-c", script],
        env=environment(**named),
        capture_output=True,
        text=True,
        check=True,
        timeout=PATIENCE_S,
    )

    assert told.stdout.strip() == str(list(SPARING.values()))


def test_the_page_on_clusters_has_the_same_for_workers_that_a_person_starts():
    assert pages.files("cluster")["worker.sh"].splitlines() == exports()


def test_a_job_exports_them_before_what_its_user_wants():
    pytest.importorskip("dask_jobqueue")
    cluster = JobQueue("slurm", interface="lo", prologue=["export MINE=1"])._cluster()
    try:
        lines = cluster.job_script().splitlines()
    finally:
        cluster.close()

    assert [line for line in lines if line.startswith("export ")] == [*exports(), "export MINE=1"]


class FakeClient:
    """A client of a scheduler with one worker more each time that one asks."""

    def __init__(self):
        self.asked = 0

    def scheduler_info(self, n_workers):
        self.asked += 1
        return {"workers": {number: {"nthreads": 2} for number in range(self.asked)}}


def test_the_scheduler_is_asked_for_its_threads_once_a_second(monkeypatch):
    client, now_s = FakeClient(), [100.0]
    monkeypatch.setattr(dask_cluster.time, "monotonic", lambda: now_s[0])
    slots = Slots(client, 1)

    assert [slots() for _ in range(5)] == [4] * 5
    now_s[0] += dask_cluster.BELIEVED_S
    assert [slots() for _ in range(5)] == [8] * 5
    assert client.asked == 2
