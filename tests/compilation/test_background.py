"""Compilation in parallel: of the loop for figures, and of the loops of a sweep."""

import os
import subprocess
import sys

import pytest
from filelock import FileLock

from jerkbench.adaptation.mtf import Mtf
from jerkbench.adaptation.none import NoAdaptation
from jerkbench.adaptation.student_t import StudentT
from jerkbench.compilation import module_cache
from jerkbench.compilation.module_cache import BEFORE_WAITING, LOOPS, load_entry
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.filters.gnss_only import GnssOnly
from jerkbench.filters.kinematic import Baseline, Jerk
from jerkbench.kinematic import loop
from jerkbench.kinematic.arguments import AT_ONCE


@pytest.fixture
def begun(monkeypatch, tmp_path):
    """The code of each process that would be started, with an empty cache."""
    monkeypatch.setenv("JERKBENCH_CACHE", str(tmp_path))
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    codes = []
    monkeypatch.setattr(loop, "run_beside", codes.append)
    return codes


@pytest.mark.slow
def test_the_other_process_leaves_the_loop_on_the_disk(begun):
    CompiledEngine().prepare(Baseline())
    (code,) = begun
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)

    CompiledEngine().prepare(Baseline())
    assert len(begun) == 1


SOURCE = """from numba import njit


@njit("float64(float64)", cache=True)
def entry(x):
    return 2.0 * x
"""


def test_a_process_does_something_else_before_it_waits_for_another_compiler(monkeypatch, tmp_path):
    monkeypatch.setenv("JERKBENCH_CACHE", str(tmp_path))
    compiled = load_entry("a loop", SOURCE, "key", lambda _: {})
    (path,) = tmp_path.rglob("*.compiled")
    path.unlink()
    monkeypatch.delitem(sys.modules, compiled.__name__)
    lock = FileLock(path.with_suffix(".lock"))
    lock.acquire()
    released = []
    monkeypatch.setattr(module_cache, "BEFORE_WAITING", [lambda: released.append(lock.release())])

    loaded = load_entry("a loop", SOURCE, "key", lambda _: {})

    assert len(released) == 1
    assert loaded.entry(1.5) == 3.0


def test_it_compiles_the_other_loops_of_the_sweep(monkeypatch):
    monkeypatch.setenv(LOOPS, "")
    methods = [(Baseline(), NoAdaptation()), (Jerk(), NoAdaptation()), (Jerk(), Mtf()), (Jerk(), StudentT())]
    CompiledEngine().announce([*methods, (GnssOnly(), NoAdaptation())])
    tried = []

    def loop_for(n, width, *, dense, asked):
        tried.append((n, width, dense, asked))
        if len(tried) == 1:
            BEFORE_WAITING[0]()  # as if another process was compiling this one

    monkeypatch.setattr(loop, "loop_for", loop_for)
    (compile_announced,) = BEFORE_WAITING
    compile_announced()

    assert tried == [(2, 8, False, AT_ONCE), (3, 8, False, AT_ONCE), (3, 8, True, AT_ONCE)]
    assert list(BEFORE_WAITING) == [compile_announced]
