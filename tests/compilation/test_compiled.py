"""Compiled code on disk: what another process finds, what it does not use, and who may write it."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from commands import PATIENCE_S
from jerkbench.compilation.compiled import Compilation, private_folder

HELPER = """
CONSTANT = {constant}


def helped(x):
    return x + CONSTANT
"""
FUNCTION = """
from helping import helped


def entry(x: float) -> float:
    return 2.0 * helped(x)
"""
SCRIPT = """
from function import entry
from jerkbench.compilation.compiled import Compilation

compiled = Compilation(entry, "a function").result()
print(compiled(1.0), sum(compiled.stats.cache_hits.values()))
"""


@pytest.fixture
def process(tmp_path):
    """Run the function in a process of its own: its result, whether it was in the cache, and the messages."""

    def run(constant=1.0):
        (tmp_path / "helping.py").write_text(HELPER.format(constant=constant))
        (tmp_path / "function.py").write_text(FUNCTION)
        path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
        environment = {**os.environ, "JERKBENCH_CACHE": str(tmp_path / "cache"), "PYTHONPATH": path}
        words = [sys.executable, "-B", "-c", SCRIPT]  # no bytecode: its time stamps have seconds
        done = subprocess.run(words, env=environment, capture_output=True, text=True, check=True, timeout=PATIENCE_S)
        result, hits = done.stdout.split()
        return float(result), int(hits), done.stderr

    return run


def test_a_process_compiles_what_is_not_there_what_was_edited_and_what_is_damaged(process, tmp_path):
    assert process() == (4.0, 0, "jerkbench: Compiling a function. This is needed once and takes a few seconds.\n")
    assert process() == (4.0, 1, "")
    assert process(constant=4.0)[:2] == (10.0, 0)  # of a helper in another file
    assert process(constant=1.0)[:2] == (4.0, 1)
    for path in (tmp_path / "cache").rglob("*.nb?"):
        path.write_bytes(path.read_bytes()[:-7])
    assert process()[:2] == (4.0, 0)
    assert process()[:2] == (4.0, 1)


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="Windows has no such modes")
def test_a_folder_that_others_can_write_to_is_not_used(process, tmp_path):
    (tmp_path / "cache" / "compiled").mkdir(parents=True)
    (tmp_path / "cache" / "compiled").chmod(0o777)
    result, hits, message = process()
    assert (result, hits) == (4.0, 0)
    assert "other users can write to" in message
    assert not list((tmp_path / "cache").rglob("*.nbc"))


def test_a_link_is_not_followed(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("JERKBENCH_CACHE", str(tmp_path))
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "compiled").symlink_to(tmp_path / "elsewhere")
    assert private_folder("anything") is None
    assert "is not a folder" in capsys.readouterr().err


def doubled(x: float) -> float:
    return factor * x


factor = 2.0


def test_a_constant_is_part_of_the_key(monkeypatch):
    before = Compilation(doubled, None).key
    monkeypatch.setitem(doubled.__globals__, "factor", 3.0)
    assert Compilation(doubled, None).key != before
    assert Path(__file__).is_file()
