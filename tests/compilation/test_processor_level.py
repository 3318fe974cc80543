"""The level of the processor, for which machine code is made."""

import re
import subprocess
from pathlib import Path

import pytest
from llvmlite import binding

from jerkbench.compilation.module_cache import PROCESSOR_LEVELS, level_of_processor

LOADER = Path("/lib64/ld-linux-x86-64.so.2")


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
