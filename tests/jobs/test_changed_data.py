"""Data that change while a sweep uses them: no row is stored under the hash of other data."""

import os

import numpy as np
import pytest

from jerkbench.datasets.path import DrivenPath
from jerkbench.io.files import fingerprint
from jerkbench.jobs.inputs import shared_inputs
from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.plan import planned
from jerkbench.jobs.run import run_missing
from jerkbench.jobs.store import Store


def write(path, radius_m):
    t_s = np.arange(0.0, 20.0, 0.5)
    lines = [f"{t:.2f},{radius_m * np.cos(t / 10):.6f},{radius_m * np.sin(t / 10):.6f},0" for t in t_s]
    path.write_text("t_s,east_m,north_m,up_m\n" + "\n".join(lines) + "\n")


@pytest.fixture
def table(tmp_path):
    path = tmp_path / "drive.csv"
    write(path, 20.0)
    return path


@pytest.fixture
def plan(table):
    spec = {
        "dataset": {"name": "path", "file": str(table)},
        "disturbance": [{"name": "none"}],
        "attitude": {"name": "tilt"},
        "filter": {"name": "baseline"},
        "adaptation": {"name": "none"},
        "engine": {"name": "compiled"},
    }
    return planned([build(spec, Protocol(seeds=2))])


@pytest.fixture(autouse=True)
def _nothing_in_memory():
    shared_inputs.cache_clear()


def rows_after_sweep(plan, folder):
    store = Store(folder)
    store.prepare()
    run_missing(plan, store)
    (stored,), _ = store.read()
    return stored.rows


def test_data_that_changed_after_planning_give_no_row(plan, table, tmp_path):
    write(table, 21.0)
    rows = rows_after_sweep(plan, tmp_path)

    assert list(rows["status"]) == ["failed", "failed"]
    assert rows["reason"].str.contains("have changed since they were hashed").all()
    assert Store(tmp_path).known(plan.draws) == {}


def test_data_that_change_while_they_are_read_give_no_row(plan, table, tmp_path, monkeypatch):
    load = DrivenPath.load

    def changing(dataset, seed):
        recording = load(dataset, seed)
        write(table, 22.0 + seed)
        return recording

    monkeypatch.setattr(DrivenPath, "load", changing)
    assert list(rows_after_sweep(plan, tmp_path)["status"]) == ["failed", "failed"]


def test_a_change_that_keeps_size_and_time_changes_the_hash(tmp_path):
    path = tmp_path / "data"
    path.write_bytes(b"before")
    stat = path.stat()
    before = fingerprint((path,))
    path.write_bytes(b"after_")
    os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))

    assert fingerprint((path,)) != before
