"""Simulated recordings that are kept: the same ones, and none that another code or data set has made."""

import dataclasses

import numpy as np
import pytest

from jerkbench.datasets.field import Field
from jerkbench.datasets.path import DrivenPath
from jerkbench.jobs import inputs as simulated
from jerkbench.recording import Recording


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


def test_another_parameter_seed_or_code_is_another_recording(folder, monkeypatch):
    for dataset, seed in ((Field(duration_s=8.0), 1), (Field(duration_s=8.0), 2), (Field(duration_s=9.0), 1)):
        simulated.simulated(dataset, seed)
    assert len(list(folder.glob(simulated.SIMULATED_PATTERN))) == 3
    monkeypatch.setattr(simulated, "code_digest", lambda: "another")
    simulated.simulated(Field(duration_s=8.0), 1)
    assert len(list(folder.glob(simulated.SIMULATED_PATTERN))) == 4


@pytest.mark.parametrize("damage", ["cut", "flipped", "empty", "other"])
def test_what_is_damaged_is_simulated_again(folder, damage):
    wanted = simulated.simulated(Field(duration_s=8.0), 1)
    (path,) = folder.glob(simulated.SIMULATED_PATTERN)
    whole = path.read_bytes()
    flipped = whole[:9000] + bytes([whole[9000] ^ 1]) + whole[9001:]
    path.write_bytes({"cut": whole[:-5000], "flipped": flipped, "empty": b"", "other": b"PK" + bytes(200)}[damage])
    same(simulated.simulated(Field(duration_s=8.0), 1), wanted)
    assert isinstance(simulated._read(path), Recording)


def test_what_others_may_write_to_is_not_unpickled(folder, capsys):
    wanted = simulated.simulated(Field(duration_s=8.0), 1)
    (path,) = folder.glob(simulated.SIMULATED_PATTERN)
    path.chmod(0o666)

    same(simulated.simulated(Field(duration_s=8.0), 1), wanted)
    assert f"{path} is not used, the drive is simulated again: others may write to it" in capsys.readouterr().err


def test_the_longest_unused_go_when_there_are_too_many(folder, monkeypatch):
    monkeypatch.setattr(simulated, "MAX_DRIVE_BYTES", 1)
    for seed in (1, 2, 16):
        simulated.simulated(Field(duration_s=8.0), seed)
    assert len(list(folder.glob(simulated.SIMULATED_PATTERN))) == 1


def test_a_folder_that_takes_nothing_is_no_obstacle(tmp_path, monkeypatch):
    monkeypatch.setenv("JERKBENCH_CACHE", str(tmp_path / "file"))
    (tmp_path / "file").touch()
    same(simulated.simulated(Field(duration_s=8.0), 1), Field(duration_s=8.0).load(1))
