"""The compilation of what a figure will need, beside the run, by a process of its own."""

import gc
import os
import subprocess
import sys
import warnings

import pytest

from jerkbench.compilation.compiled_loop import RUNNING, run_beside
from jerkbench.compilation.module_cache import target
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.filters.kinematic import Baseline
from jerkbench.kinematic import loop


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


def test_with_one_processor_nothing_is_begun(begun, monkeypatch):
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    CompiledEngine().prepare(Baseline())
    assert begun == []


def test_a_process_that_still_runs_is_no_warning(recwarn):
    """Python warns where the object of a running process is collected; tests take warnings for errors."""
    warnings.simplefilter("always")
    run_beside("import time; time.sleep(60)")
    gc.collect()

    assert not recwarn.list
    process = RUNNING.pop()
    process.kill()
    process.wait()


def test_it_compiles_for_what_this_process_compiles_for(tmp_path):
    told = tmp_path / "told"
    run_beside(f"import os, pathlib; pathlib.Path({str(told)!r}).write_text(os.environ['NUMBA_CPU_NAME'])")
    RUNNING.pop().wait(60)

    assert told.read_text() == target()[1]


SOURCE = """
from numba import njit


@njit("int64(int64)", cache=True)
def entry(n):
    return n + 3
"""
HOLDING = """
import sys
from filelock import FileLock

with FileLock(sys.argv[1]):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_who_waits_for_another_process_says_so(monkeypatch, tmp_path):
    """The other process ends when it has been said: otherwise this waits for ever."""
    from jerkbench.compilation import module_cache as entries

    monkeypatch.setenv("JERKBENCH_CACHE", str(tmp_path))
    lock = entries._path(entries._module_name("a loop", SOURCE, "key")).with_suffix(".lock")
    words, said = [sys.executable, "-c", HOLDING, str(lock)], []
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout.readline() == "held\n"
        monkeypatch.setattr(entries, "notify", lambda text, *_: said.append(text) or holder.stdin.close())
        assert entries.load_entry("a loop", SOURCE, "key", lambda _: {}).entry(1) == 4

    assert said[0] == "waiting for a loop, which another process is compiling"
