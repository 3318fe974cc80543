"""Inputs of runs: data that change during a sweep, and cached simulations."""

import dataclasses
import os

import numpy as np
import pytest

from jerkbench.datasets.field import Field
from jerkbench.datasets.path import DrivenPath
from jerkbench.io.files import fingerprint
from jerkbench.jobs import rows as simulated
from jerkbench.jobs.job import Protocol, build
from jerkbench.jobs.plan import planned
from jerkbench.jobs.rows import shared_inputs
from jerkbench.jobs.run import run_missing
from jerkbench.jobs.store import Store
from jerkbench.recording import Recording


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
    assert rows["reason"].str.contains("have changed: their hash was").all()
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


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("JERKBENCH_CACHE", str(tmp_path))
    return tmp_path / simulated.SIMULATED


def same(one, other):
    """Whether two dataclasses hold the same values, to the bit, of the same types."""
    assert type(one) is type(other)
    if not dataclasses.is_dataclass(one):
        assert one == other
        return
    for field in dataclasses.fields(one):
        a, b = getattr(one, field.name), getattr(other, field.name)
        if isinstance(a, np.ndarray):
            assert a.dtype == b.dtype
            np.testing.assert_array_equal(a, b)
        else:
            same(a, b)


@pytest.mark.parametrize("dataset", [Field(duration_s=8.0), DrivenPath()], ids=["field", "path"])
def test_what_is_kept_is_what_was_simulated(dataset, folder, monkeypatch):
    wanted = dataset.load(3)
    same(simulated.simulated(dataset, 3), wanted)
    monkeypatch.setattr(type(dataset), "load", None)
    same(simulated.simulated(dataset, 3), wanted)
    assert len(list(folder.glob(simulated.SIMULATED_PATTERN))) == 1


def test_another_parameter_seed_or_code_is_another_recording_and_the_longest_unused_go(folder, monkeypatch):
    for dataset, seed in ((Field(duration_s=8.0), 1), (Field(duration_s=8.0), 2), (Field(duration_s=9.0), 1)):
        simulated.simulated(dataset, seed)
    assert len(list(folder.glob(simulated.SIMULATED_PATTERN))) == 3
    monkeypatch.setattr(simulated, "code_digest", lambda: "another")
    simulated.simulated(Field(duration_s=8.0), 1)
    assert len(list(folder.glob(simulated.SIMULATED_PATTERN))) == 4
    monkeypatch.setattr(simulated, "MAX_DRIVE_BYTES", 1)
    for seed in (1, 2, 16):
        simulated.simulated(Field(duration_s=8.0), seed)
    assert len(list(folder.glob(simulated.SIMULATED_PATTERN))) == 1


@pytest.mark.parametrize("damage", ["cut", "flipped", "empty", "other"])
def test_what_is_damaged_is_simulated_again(folder, damage):
    wanted = simulated.simulated(Field(duration_s=8.0), 1)
    (path,) = folder.glob(simulated.SIMULATED_PATTERN)
    whole = path.read_bytes()
    flipped = whole[:9000] + bytes([whole[9000] ^ 1]) + whole[9001:]
    path.write_bytes({"cut": whole[:-5000], "flipped": flipped, "empty": b"", "other": b"PK" + bytes(200)}[damage])
    same(simulated.simulated(Field(duration_s=8.0), 1), wanted)
    assert isinstance(simulated._read(path), Recording)


def test_what_others_may_write_to_is_not_unpickled_and_a_folder_that_takes_nothing_no_obstacle(
    folder, capsys, tmp_path, monkeypatch
):
    wanted = simulated.simulated(Field(duration_s=8.0), 1)
    (path,) = folder.glob(simulated.SIMULATED_PATTERN)
    path.chmod(0o666)
    same(simulated.simulated(Field(duration_s=8.0), 1), wanted)
    assert f"The cached drive {path} is ignored, because other users may write to the file." in capsys.readouterr().err
    monkeypatch.setenv("JERKBENCH_CACHE", str(tmp_path / "file"))
    (tmp_path / "file").touch()
    same(simulated.simulated(Field(duration_s=8.0), 1), Field(duration_s=8.0).load(1))
