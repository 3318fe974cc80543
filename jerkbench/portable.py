"""Portable arithmetic: results that are equal to the bit on every processor that has the instructions of a target.

Four things round otherwise on another processor. Each is fixed by the environment in which a process starts, workers
inherit it, and the compiler is told by `target`:

- compiled code fuses a product and a sum where there is such an instruction: portable code never does;
- the C library has a sine, an exponential, ... for each kind of processor (glibc's own choice);
- so has NumPy, of exp, log, power and tanh among others;
- OpenBLAS sums in an order of its own on each.

What remains: another C library, or other versions of NumPy and OpenBLAS (a worker with other versions is refused), and
processors of another family (arm64 has its own target, and its own bits of sine and exponential).
"""

import os
import platform
import sys
from collections.abc import Mapping, Sequence
from typing import Any

MARK = "JERKBENCH_PORTABLE"
"""In the environment of a portable process: its target."""

WORD = "portable=true"
"""On the command line."""

TARGETS = {"x86_64": "x86-64-v2", "AMD64": "x86-64-v2"}
"""What machine code is made for, by machine: without fused instructions, and with all that NumPy requires."""

GENERIC = "generic"
"""The target of every other machine."""

GLIBC = ",".join(f"-{name}" for name in ("AVX2", "FMA", "FMA4", "AVX512F", "AVX2_Usable", "FMA_Usable", "FMA4_Usable"))
"""Instructions that glibc's functions leave alone; the last three are the names before glibc 2.33."""


def target() -> str:
    """Return what this process makes machine code for; empty: for the processor that it runs on."""
    return os.environ.get(MARK, "")


def environment(before: Mapping[str, str]) -> dict[str, str]:
    """Return the environment ``before`` with what makes a process portable."""
    name = TARGETS.get(platform.machine(), GENERIC)
    fixed = {MARK: name, "NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": "", "NUMBA_DISABLE_INTEL_SVML": "1"}
    fixed["NPY_DISABLE_CPU_FEATURES"] = " ".join(_dispatched())
    if name != GENERIC:
        fixed["OPENBLAS_CORETYPE"] = "Nehalem"  # the last without fused instructions
        kept = [word for word in before.get("GLIBC_TUNABLES", "").split(":") if word and "cpu.hwcaps" not in word]
        fixed["GLIBC_TUNABLES"] = ":".join([*kept, f"glibc.cpu.hwcaps={GLIBC}"])
    return {**before, **fixed}


def start_again_portable(words: Sequence[str]) -> None:
    """Start this program again in the environment of a portable process, where ``words`` or the environment ask for it.

    Libraries read it as they are loaded: later is too late.
    """
    if WORD in words or target():
        wanted = environment(os.environ)
        if wanted != dict(os.environ):
            sys.stdout.flush()
            os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], wanted)  # noqa: S606 - this very program


def _dispatched() -> list[str]:
    """The instructions for which NumPy has functions of their own."""
    import numpy as np

    config: Any = np.show_config(mode="dicts")
    known = config["SIMD Extensions"]
    return [*known.get("found", []), *known.get("not found", [])]
