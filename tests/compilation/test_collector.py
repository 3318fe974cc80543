"""Python's collector of garbage, which waits while something compiles."""

import gc

import pytest

from jerkbench.compilation.module_cache import load_entry

SOURCE = """from numba import njit


@njit("float64(float64)", cache=True)
def entry(x):
    return 2.0 * x
"""


@pytest.fixture
def seen(monkeypatch, tmp_path):
    """Whether it is on, each time that an entry point asks for its names."""
    monkeypatch.setenv("JERKBENCH_CACHE", str(tmp_path))
    return []


def test_it_waits_and_goes_on(seen):
    load_entry("doubling", SOURCE, "a collected key", lambda _: seen.append(gc.isenabled()) or {})

    assert seen == [False]
    assert gc.isenabled()


def test_it_goes_on_after_an_error_too(seen):
    def missing(_):
        raise LookupError

    with pytest.raises(LookupError):
        load_entry("doubling", SOURCE, "another collected key", missing)
    assert gc.isenabled()


def test_it_stays_off_where_it_was_off(seen):
    gc.disable()
    try:
        load_entry("doubling", SOURCE, "a third collected key", lambda _: seen.append(gc.isenabled()) or {})
        assert not gc.isenabled()
    finally:
        gc.enable()
