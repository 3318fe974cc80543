"""Fixtures of all tests."""

from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import settings

from jerkbench.cli import main

settings.register_profile("any speed", deadline=None)  # how fast a machine is fails no test
settings.load_profile("any speed")

SHARED = Path(__file__).parents[2] / "shared"


@pytest.fixture(scope="session")
def shared_folder():
    """The folder with the reference values and the real recordings, which is not part of the product."""
    if not SHARED.is_dir():
        pytest.skip("the folder ../shared with reference values and recordings is not there")
    return SHARED


@pytest.fixture
def typed(tmp_path, monkeypatch, capsys):
    """Types a command in an empty folder, in this process: the output and the exit code."""
    monkeypatch.chdir(tmp_path)

    def run(*words):
        code = 0
        try:
            main(words)
        except SystemExit as end:
            code = end.code
        printed = capsys.readouterr()
        return SimpleNamespace(returncode=code, stdout=printed.out, stderr=printed.err)

    return run
