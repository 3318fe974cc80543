"""The compilation of what a figure will need, beside the run, by a process of its own."""

import os
import subprocess
import sys

import pytest

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
