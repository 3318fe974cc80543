"""The compiled code of a plugin: an edit changes the next result, and a second process compiles nothing."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.compilation.compiled import COMPILED
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.files import cache_folder
from jerkbench.filters.kinematic import Baseline
from rough import rough_timeline

HELPER = """
def factor():
    return {factor}
"""
PLUGIN = """
from dataclasses import dataclass

from helping import factor


@dataclass(frozen=True)
class Scaled:
    gain: float = 1.0

    def adapt(self, innovation, HPHt, R, rows, memory):
        return self.gain * factor() * R
"""
SCRIPT = """
import sys

from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.engines.filterpy_engine import FilterpyEngine
from jerkbench.filters.kinematic import Baseline
from plugin import Scaled
from rough import rough_timeline

timeline, rule = rough_timeline(2.0), Scaled(float(sys.argv[1]))
ends = [engine.run(timeline, Baseline(), rule).position_m[-1, 0] for engine in (CompiledEngine(), FilterpyEngine())]
print(*ends)
"""


@pytest.fixture
def process(tmp_path):
    """Run the plugin in a process: the end of the compiled run and of the reference, and the messages.

    The loop of the filter is compiled before, in the cache of this session; the rules of other tests are not there.
    """
    CompiledEngine().run(rough_timeline(0.5), Baseline(), NoAdaptation())
    own = shutil.ignore_patterns("adapt_*", "gain_*", "*.tmp.*")  # what another process is writing
    shutil.copytree(cache_folder(COMPILED), tmp_path / "cache" / COMPILED, ignore=own)

    def run(factor, gain=1.0):
        (tmp_path / "helping.py").write_text(HELPER.format(factor=factor))
        (tmp_path / "plugin.py").write_text(PLUGIN)
        path = os.pathsep.join([str(tmp_path), str(Path(__file__).parents[1]), *sys.path])
        environment = {**os.environ, "JERKBENCH_CACHE": str(tmp_path / "cache"), "PYTHONPATH": path}
        words = [sys.executable, "-B", "-c", SCRIPT, str(gain)]
        done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True, timeout=300)
        compiled, reference = map(float, done.stdout.split())
        assert compiled == pytest.approx(reference, rel=1e-12)
        return compiled, done.stderr

    return run


def test_an_edit_of_its_helper_changes_the_next_run(process):
    first, message = process(2.0)
    assert message == "jerkbench: Compiling adaptation Scaled. This is needed once and takes a few seconds.\n"

    again, message = process(2.0, gain=3.0)
    assert again != first
    assert message == ""

    edited, message = process(6.0)
    assert edited == again
    assert message == "jerkbench: Compiling adaptation Scaled. This is needed once and takes a few seconds.\n"
