"""A checkout that nobody has installed says what to do."""

import pytest

from commands import jerkbench

HIDDEN = """
import importlib.metadata as metadata

real = metadata.Distribution.from_name


def from_name(name):
    if name == "jerkbench":
        raise metadata.PackageNotFoundError(name)
    return real(name)


metadata.Distribution.from_name = from_name
"""


@pytest.mark.parametrize("words", [["run"], ["list", "filter"], ["--version"]])
def test_it_says_how_to_install_it(tmp_path, words):
    (tmp_path / "sitecustomize.py").write_text(HIDDEN)
    done = jerkbench(*words, cwd=tmp_path, PYTHONPATH=str(tmp_path))

    assert done.returncode == 2
    assert done.stderr.startswith("jerkbench: It runs from ")
    assert "-m pip install -e " in done.stderr
    assert done.stderr.count("\n") == 1
