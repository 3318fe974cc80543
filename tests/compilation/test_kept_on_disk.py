"""Compiled code on the disk: found by the next process, and not used after an edit."""

import os
import subprocess
import sys

import pytest

PLUGIN = """
from dataclasses import dataclass

from helping import helped


@dataclass(frozen=True)
class Rule:
    factor: float = 2.0

    def memory_size(self):
        return 0

    def adapt(self, innovation, HPHt, R, rows, memory):
        return helped(R, self.factor)
"""
HELPER = "def helped(R, factor):\n    return R * factor + {constant}\n"
SCRIPT = """
import sys
import numpy as np
from numba import njit
from jerkbench.compilation.methods import fill_by
from jerkbench.kinematic.plugin_call import ADAPT, address_of, compiled_method, parameter_vector
from rule import Rule


@njit
def call(address, arrays, sizes):
    fill_by(address, arrays, sizes)


plugin = Rule(float(sys.argv[1]))
function, result, one = compiled_method(plugin, ADAPT), np.zeros(1), np.ones(1)
call(address_of(function), (parameter_vector(plugin), one, one, one, np.zeros(1, dtype=np.int64), one, result), (1, 1))
print(result[0], sum(function.stats.cache_misses.values()), sum(function.stats.cache_hits.values()))
"""


def path_with(folder):
    """The places of modules, with ``folder`` before those that lead to the code under test."""
    return os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")]).rstrip(os.pathsep)


@pytest.fixture
def process(tmp_path):
    """Write the plugin and its helper, run it in a process of its own: (value, compiled, found), and what it said."""

    def run(constant=1.0, factor=2.0, plugin=PLUGIN):
        (tmp_path / "rule.py").write_text(plugin)
        (tmp_path / "helping.py").write_text(HELPER.format(constant=constant))
        environment = {**os.environ, "JERKBENCH_CACHE": str(tmp_path / "cache"), "PYTHONPATH": path_with(tmp_path)}
        words = [sys.executable, "-c", SCRIPT, str(factor)]
        done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True, timeout=120)
        return tuple(map(float, done.stdout.split())), done.stderr

    return run


def test_the_second_process_compiles_nothing_whatever_the_parameters_are(process):
    first, said = process(factor=2.0)
    second, silence = process(factor=5.0)

    assert first == (3.0, 1, 0)
    assert second == (6.0, 0, 1)
    assert said.startswith("jerkbench: Compiling Rule.adapt. Needed once; a few seconds.")
    assert silence == ""


@pytest.mark.slow
def test_an_edit_of_a_helper_in_another_file_is_noticed_and_undoing_it_is_too(process):
    process(constant=1.0)

    assert process(constant=4.0)[0] == (6.0, 1, 0)
    assert process(constant=1.0)[0] == (3.0, 0, 1)


COUNTING = """
LEAF = 0.0


def count(n):
    return LEAF if n < 2 else count(n - 1) + count(n - 2)
"""
TWO_SIZES = """
import sys
from counting import count
from jerkbench.compilation.module_cache import load_entry
from jerkbench.compilation.jitted import jitted

SOURCE = '''
from numba import float64, int64, njit


@njit(float64(int64), cache=True)
def entry(n):
    return count(n)
'''


def compiled(leaf):
    def namespace(home):
        return {"count": jitted(count, home, {"LEAF": leaf})}

    return load_entry("count", SOURCE, str(leaf), namespace).entry


for entry, leaf in [(compiled(float(word)), float(word)) for word in sys.argv[1:]]:
    print(entry(5), sum(entry.stats.cache_hits.values()))
"""


@pytest.mark.slow
def test_two_compilations_of_one_function_by_two_processes_do_not_take_each_others_code(tmp_path):
    """The linker of a third process knows a function by its name alone, and takes the first that it finds."""
    (tmp_path / "counting.py").write_text(COUNTING)
    environment = {**os.environ, "JERKBENCH_CACHE": str(tmp_path / "cache"), "PYTHONPATH": path_with(tmp_path)}

    def said(*leaves):
        words = [sys.executable, "-c", TWO_SIZES, *leaves]
        done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True, timeout=120)
        return done.stdout.split("\n")[:-1]

    assert said("2") == ["16.0 0"]
    assert said("3") == ["24.0 0"]
    assert said("2", "3") == ["16.0 1", "24.0 1"]


THREADS = """
from concurrent.futures import ThreadPoolExecutor
import numpy as np
from jerkbench.kinematic.plugin_call import ADAPT, compiled_method
from rule import Rule

with ThreadPoolExecutor(4) as pool:
    functions = list(pool.map(lambda _: compiled_method(Rule(), ADAPT), range(4)))
print(len(set(map(id, functions))), sum(functions[0].stats.cache_misses.values()))
"""


def test_of_threads_and_processes_that_start_together_one_compiles(tmp_path):
    (tmp_path / "rule.py").write_text(PLUGIN)
    (tmp_path / "helping.py").write_text(HELPER.format(constant=1.0))
    environment = {**os.environ, "JERKBENCH_CACHE": str(tmp_path / "cache"), "PYTHONPATH": path_with(tmp_path)}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    both = [subprocess.Popen([sys.executable, "-c", THREADS], env=environment, **pipes) for _ in range(2)]
    (one, first), (other, second) = (process.communicate(timeout=120) for process in both)

    assert sorted([one, other]) == ["1 0\n", "1 1\n"]
    assert sum("Compiling Rule.adapt." in said for said in (first, second)) == 1
    assert all(said.count("\n") <= 1 for said in (first, second))  # the other one waits, and may say so


@pytest.fixture
def kept(process, tmp_path):
    """The one file of compiled code that a first process has left."""
    process()
    (file,) = (tmp_path / "cache").rglob("*.compiled")
    return file


@pytest.mark.slow
def test_what_is_damaged_is_not_run_but_compiled_anew_and_said(process, kept):
    content = bytearray(kept.read_bytes())
    content[-2000:-1993] = b"garbage"
    kept.write_bytes(content)

    value, said = process()
    assert value == (3.0, 1, 0)
    assert said.startswith(f"jerkbench: what is kept of Rule.adapt in {kept} is not used, it is compiled anew: ")
    assert process() == ((3.0, 0, 1), "")


def test_a_module_that_somebody_put_beside_it_is_never_run(process, kept):
    (kept.parent / "__pycache__").mkdir()
    for name in (f"{kept.stem}.py", f"__pycache__/{kept.stem}.cpython-311.pyc"):
        (kept.parent / name).write_text("raise SystemExit('run')")

    assert process() == ((3.0, 0, 1), "")


def test_a_folder_that_takes_nothing_costs_time_and_one_line_but_no_run(process, tmp_path):
    (tmp_path / "cache").touch()  # a file stands where the folder should
    value, said = process()

    assert value == (3.0, 1, 0)
    assert said.startswith("jerkbench: compiled code cannot be kept in ")
    assert said.count("\n") == 1


@pytest.mark.slow
def test_numba_looks_nowhere_else(process, tmp_path, monkeypatch):
    elsewhere = tmp_path / "elsewhere"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(elsewhere))
    monkeypatch.setenv("NUMBA_CACHE_LOCATOR_CLASSES", "UserWideCacheLocator")
    process()

    assert process() == ((3.0, 0, 1), "")
    assert not elsewhere.exists()


@pytest.mark.slow
def test_a_processor_of_another_kind_has_code_of_its_own(process, monkeypatch):
    process()
    monkeypatch.setenv("NUMBA_CPU_NAME", "generic")
    monkeypatch.setenv("NUMBA_CPU_FEATURES", "")
    assert process()[0] == (3.0, 1, 0)
    assert process()[0] == (3.0, 0, 1)
    monkeypatch.undo()

    assert process()[0] == (3.0, 0, 1)
