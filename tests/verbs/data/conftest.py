from types import SimpleNamespace

import pytest

from jerkbench.cli import main


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
        said = capsys.readouterr()
        return SimpleNamespace(returncode=code, stdout=said.out, stderr=said.err)

    return run
