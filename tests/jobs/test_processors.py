"""The kind of processor that a result comes from, against what the system says."""

from pathlib import Path

import pytest

from jerkbench.jobs.key import processor_kind

CPUINFO = Path("/proc/cpuinfo")
FLAGS = {"sse2": "sse2", "sse4.2": "sse4_2", "avx": "avx", "avx2": "avx2", "fma": "fma", "avx512f": "avx512f"}
"""LLVM's names of instructions, and Linux's."""


@pytest.mark.skipif(not CPUINFO.exists() or "sse2" not in CPUINFO.read_text(), reason="needs Linux on x86-64")
def test_the_instructions_for_arithmetic_are_those_that_the_system_names():
    family, _, names = processor_kind().partition(": ")
    flags = next(line for line in CPUINFO.read_text().splitlines() if line.startswith("flags")).split()

    assert family
    assert {name for name in FLAGS if name in names.split()} == {name for name, flag in FLAGS.items() if flag in flags}
