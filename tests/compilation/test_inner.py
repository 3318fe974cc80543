"""Functions that only compiled code calls: they do what Python does, and no machine code is made of them alone."""

import os
import subprocess
import sys

import pytest

from jerkbench.compilation.jitted import jitted


def refused(n):
    if n < 0:
        raise ValueError("n is negative; give one that is not.")
    return n


TALKING = """
def shown(x):
    print("value", x)
    return x


def refused(x):
    if x > 3.0:
        raise ValueError("too much", x)
    return x


def said(x):
    return refused(shown(x))
"""
TALK = """
from jerkbench.compilation.module_cache import load_entry
from jerkbench.compilation.jitted import jitted
from talking import said

SOURCE = '''
from numba import njit


@njit("float64(float64)", cache=True, nogil=True)
def entry(x):
    return said(x)
'''
entry = load_entry("talk", SOURCE, "key", lambda home: {"said": jitted(said, home)}).entry
print(entry(2.0), sum(entry.stats.cache_hits.values()))
try:
    entry(4.0)
except ValueError as error:
    print(error.args)
"""


def test_what_an_inner_function_hands_to_python_arrives_in_the_first_process_and_in_the_second(tmp_path):
    """It needs numba's "environment" of that function; without one a process that compiles waited for ever."""
    (tmp_path / "talking.py").write_text(TALKING)
    environment = {**os.environ, "JERKBENCH_CACHE": str(tmp_path / "cache")}
    environment["PYTHONPATH"] = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])
    for hits in (0, 1):
        words = [sys.executable, "-c", TALK]
        done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True, timeout=60)
        assert done.stdout.splitlines() == ["value 2.0", f"2.0 {hits}", "value 4.0", "('too much', 4.0)"]


def even(n):
    return True if n == 0 else odd(n - 1)


def odd(n):
    return False if n == 0 else even(n - 1)


def test_functions_that_call_each_other_are_refused():
    """What numba keeps of them on the disk would end the process that loads it."""
    with pytest.raises(TypeError, match="call each other"):
        jitted(even, __name__)
