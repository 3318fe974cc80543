"""A portable process computes the same bits whatever machine code its compiler would make."""

import hashlib
import os
import shutil
import subprocess
import sys

import pytest
from omegaconf import OmegaConf

from jerkbench import portable
from jerkbench.cells.cell import build
from jerkbench.cells.key import cell_key
from jerkbench.cells.protocol import Protocol
from jerkbench.clusters.identity import identity_of, refusal
from jerkbench.errors import PluginError
from jerkbench.execution.processors import processor_kind
from jerkbench.hydra_app.configuration import Schema
from jerkbench.hydra_app.options import check_options
from jerkbench.portable import MARK, environment, start_again_portable

KERNEL = """
import hashlib
import numpy as np
from numba import njit
from jerkbench.compilation.jitted import jitted


def smoothed(a, b, out):
    sum_ = 0.0
    for k in range(len(a)):
        sum_ = sum_ * 0.3 + a[k] * b[k]
        out[k] = sum_


kernel = jitted(smoothed, __name__, kernel=True)


@njit
def run(a, b):
    out = np.empty(len(a))
    kernel(a, b, out)
    return out


a, b = np.random.default_rng(1).standard_normal((2, 5000))
plain, sum_ = np.empty(5000), np.float64(0.0)
for k in range(5000):
    sum_ = sum_ * 0.3 + a[k] * b[k]  # NumPy's scalars: each operation rounds
    plain[k] = sum_
print(hashlib.sha256(run(a, b).tobytes()).hexdigest(), hashlib.sha256(plain.tobytes()).hexdigest())
"""

LIBRARIES = """
import hashlib, math
import numpy as np
x = 3 * np.random.default_rng(1).standard_normal(20_000)
first, second = x[:1800].reshape(2, 30, 30)
for numbers in ([math.sin(v) + math.exp(v) for v in x], np.exp(x), np.abs(x) ** 1.7, first @ second):
    print(hashlib.sha256(np.ascontiguousarray(numbers).tobytes()).hexdigest())
"""
"""A line each from the C library, NumPy twice and BLAS."""


def features():
    from llvmlite import binding

    return binding.get_host_cpu_features()


fused = pytest.mark.skipif(
    not (features().get("fma") and features().get("avx2")), reason="needs a processor that fuses a product and a sum"
)


def printed(script, tmp_path, **variables):
    path = tmp_path / f"script_{hashlib.sha256(script.encode()).hexdigest()[:8]}.py"
    path.write_text(script, encoding="utf-8")
    variables = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **variables}
    return subprocess.run(
        [sys.executable, str(path)], env=variables, capture_output=True, text=True, check=True
    ).stdout.split()


@pytest.mark.slow
@fused
def test_two_targets_give_the_same_bits_in_a_portable_process_and_others_elsewhere(tmp_path):
    """Against NumPy's scalars, each operation of which rounds."""
    targets = [{"NUMBA_CPU_NAME": name, "NUMBA_CPU_FEATURES": ""} for name in ("x86-64-v2", "x86-64-v3")]
    own = [printed(KERNEL, tmp_path, **named) for named in targets]
    fixed = [printed(KERNEL, tmp_path, **{**environment({}), **named}) for named in targets]

    assert [compiled == plain for compiled, plain in own] == [True, False]
    assert [compiled == plain for compiled, plain in fixed] == [True, True]


@fused
def test_the_libraries_use_no_fused_instructions_in_a_portable_process(tmp_path):
    """Each rounds otherwise where it may use what this processor has, and as it does where it may not."""
    own, fixed = printed(LIBRARIES, tmp_path), printed(LIBRARIES, tmp_path, **environment({}))
    single = {
        0: {"GLIBC_TUNABLES": environment({})["GLIBC_TUNABLES"]},
        3: {"OPENBLAS_CORETYPE": environment({})["OPENBLAS_CORETYPE"]},
    }

    assert [ours != theirs for ours, theirs in zip(own, fixed, strict=True)] == [True] * 4
    for line, variables in single.items():
        assert printed(LIBRARIES, tmp_path, **variables)[line] == fixed[line]


def test_the_environment_keeps_what_else_is_in_it():
    before = {"HOME": "/root", "GLIBC_TUNABLES": "glibc.malloc.check=1:glibc.cpu.hwcaps=-AVX2"}
    after = environment(before)

    assert after["HOME"] == "/root"
    assert environment(after) == after
    if after[MARK] != portable.GENERIC:
        assert after["GLIBC_TUNABLES"].startswith("glibc.malloc.check=1:glibc.cpu.hwcaps=-AVX2,-FMA,")
        assert after["GLIBC_TUNABLES"].count("cpu.hwcaps") == 1


@pytest.fixture
def started(monkeypatch):
    """The environments in which this program was started again."""
    calls = []
    monkeypatch.setattr(portable.os, "execve", lambda path, words, variables: calls.append((words, variables)))
    monkeypatch.delenv(MARK, raising=False)
    return calls


def test_only_who_asks_for_it_is_started_again_and_once(started, monkeypatch):
    start_again_portable(["run", "filter=jerk"])
    assert started == []
    start_again_portable(["run", "filter=jerk", "portable=true"])
    ((words, variables),) = started
    assert words == [sys.executable, *sys.orig_argv[1:]]
    assert variables == environment(os.environ)

    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    start_again_portable(["run", "filter=jerk", "portable=true"])
    assert len(started) == 1


def simulated():
    names = {"dataset": "field", "attitude": "tilt", "filter": "jerk", "adaptation": "none", "engine": "compiled"}
    return build(
        {**{kind: {"name": name} for kind, name in names.items()}, "disturbance": [{"name": "none"}]}, Protocol()
    )


def test_key_processor_and_identity_say_it(monkeypatch):
    cell = simulated()
    own = cell_key(cell, "data"), processor_kind(), identity_of([])
    monkeypatch.setenv(MARK, "x86-64-v2")
    processor_kind.cache_clear()
    fixed = cell_key(cell, "data"), processor_kind(), identity_of([])
    monkeypatch.undo()
    processor_kind.cache_clear()

    assert fixed[0] != own[0]
    assert fixed[1] == "portable x86-64-v2"
    assert (own[2].arithmetic, fixed[2].arithmetic) == ("", "x86-64-v2")
    assert "has no JERKBENCH_PORTABLE in its environment and the plan JERKBENCH_PORTABLE=x86-64-v2" in refusal(fixed[2])


def test_a_preset_cannot_ask_for_it(monkeypatch):
    monkeypatch.delenv(MARK, raising=False)
    with pytest.raises(PluginError, match="portable=true belongs on the command line"):
        check_options(OmegaConf.structured(Schema(portable=True)))


EMULATOR = shutil.which("qemu-x86_64")
OLD, NEW = "Nehalem", "Haswell-noTSX"


@pytest.mark.skipif(not EMULATOR or sys.platform != "linux", reason="needs qemu-user, which emulates other processors")
def test_processors_with_other_instructions_give_the_same_bits(tmp_path):
    """Two processors, emulated: one that fuses a product and a sum, and one that does not."""

    def on(processor, variables):
        path = tmp_path / "libraries.py"
        path.write_text(LIBRARIES, encoding="utf-8")
        command = [str(EMULATOR), "-cpu", processor, os.path.realpath(sys.executable), str(path)]
        variables = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), **variables}
        return subprocess.run(command, env=variables, capture_output=True, text=True, check=True).stdout.split()

    assert [ours == theirs for ours, theirs in zip(on(OLD, {}), on(NEW, {}), strict=True)] == [False] * 4
    fixed = environment({})
    assert on(OLD, fixed) == on(NEW, fixed) == printed(LIBRARIES, tmp_path, **fixed)
