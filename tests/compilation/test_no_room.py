"""Compiled code where no folder has room for it: compiled in each process, and said once."""

import errno

import pytest

from jerkbench.compilation import module_cache

SOURCE = """from numba import njit


@njit("float64(float64)", cache=True)
def entry(x):
    return offset + 2.0 * x
"""


@pytest.fixture
def full(monkeypatch, tmp_path):
    """A disk on which no file of numba's has room."""
    monkeypatch.setenv("JERKBENCH_CACHE", str(tmp_path))

    def refuse(folder, files):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(module_cache, "_write_all", refuse)
    return tmp_path


def test_it_is_compiled_in_memory_and_nothing_is_kept(full, capfd):
    entry = module_cache.load_entry("doubling", SOURCE, "a key", lambda _: {"offset": 3.0}).entry

    assert entry(4.0) == 11.0
    assert list(full.rglob("*.compiled")) == []
    assert "finds no room" in capfd.readouterr().err
