"""The processors that we may use: how many, and which instructions they have."""

import os
from functools import cache

ARITHMETIC = ("amx", "avx", "fma", "neon", "sse", "sve")
"""Beginnings of the names of instructions that decide in which order, and how often, sums are rounded."""


def processors() -> int:
    """Return how many this process may use, which can be fewer than there are."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def processor_kind() -> str:
    """Return what machine code is made for here: the processor's family, and its instructions for arithmetic."""
    from llvmlite import binding

    features = binding.get_host_cpu_features()
    names = sorted(name for name, present in features.items() if present and name.startswith(ARITHMETIC))
    return f"{binding.get_host_cpu_name()}: {' '.join(names)}"
