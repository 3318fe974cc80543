"""Machine code that comes with a wheel: made for a level of processors, found after the cache, checked like that."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from llvmlite import binding

from jerkbench.compilation import module_cache
from jerkbench.compilation.module_cache import PROCESSOR_LEVELS, level_of_processor, load_entry

SOURCE = """
from numba import float64, njit


@njit(float64(float64), cache=True)
def entry(x):
    return factor * x
"""
LOADER = Path("/lib64/ld-linux-x86-64.so.2")


def tripled():
    """The entry point as the next process finds it, and how often numba found it compiled."""
    module = load_entry("tripling", SOURCE, "a key", lambda _: {"factor": 3.0})
    del sys.modules[module.__name__]
    return module.entry(2.0), sum(module.entry.stats.cache_hits.values())


@pytest.fixture
def shipped(tmp_path, monkeypatch):
    """The folder of a wheel into which another machine has compiled the entry point; the user has an empty cache."""
    monkeypatch.setenv("JERKBENCH_CACHE", str(tmp_path / "builder"))
    assert tripled() == (6.0, 0)
    monkeypatch.setenv("JERKBENCH_CACHE", str(tmp_path / "user"))
    monkeypatch.setattr(module_cache, "IN_WHEEL", tmp_path / "builder" / "compiled")
    return module_cache.IN_WHEEL


def test_what_a_wheel_ships_is_not_compiled_again(shipped, tmp_path, capsys):
    assert tripled() == (6.0, 1)
    assert not (tmp_path / "user").exists()
    assert capsys.readouterr().err == ""


def test_what_is_damaged_is_said_and_compiled_by_the_user(shipped, tmp_path, capsys):
    (own,) = shipped.glob("*.compiled")
    own.write_bytes(own.read_bytes()[:-7])

    assert tripled() == (6.0, 0)
    assert f"{own} is not used, it is compiled anew: it is not what was written there" in capsys.readouterr().err
    assert len(list((tmp_path / "user" / "compiled").glob("*.compiled"))) == 1


@pytest.mark.skipif(not LOADER.exists(), reason="asks the loader of glibc on x86-64")
def test_the_level_is_the_one_that_the_systems_loader_says():
    said = subprocess.run([LOADER, "--help"], capture_output=True, text=True, check=True).stdout
    supported = re.findall(r"(x86-64-v\d) \(supported", said)

    assert level_of_processor() == max(set(supported) & set(PROCESSOR_LEVELS), default=None)


@pytest.mark.parametrize(
    ("lacking", "level"),
    [((), "x86-64-v4"), (("avx512dq",), "x86-64-v3"), (("fma",), None), (("fma", "avx512f"), None)],
)
def test_a_processor_that_lacks_an_instruction_gets_a_lower_level(monkeypatch, lacking, level):
    features = {name: name not in lacking for needed in PROCESSOR_LEVELS.values() for name in needed}
    monkeypatch.setattr(binding, "get_host_cpu_features", lambda: features)

    assert level_of_processor() == level
