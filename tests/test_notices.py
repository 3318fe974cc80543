"""A notice is given once by all processes that work together."""

import subprocess
import sys

import pytest

from jerkbench import notices
from jerkbench.notices import notify, shared_notices

SAY = "from jerkbench.notices import notify; notify('compiling a', 'a'); notify('waiting for a', 'a'); notify('b')"


@pytest.fixture(autouse=True)
def fresh(monkeypatch):
    monkeypatch.setattr(notices, "_GIVEN", set())
    monkeypatch.delenv(notices.NOTICES_FOLDER, raising=False)


def said_by_another():
    return subprocess.run([sys.executable, "-c", SAY], capture_output=True, text=True, check=True, timeout=60).stderr


def test_a_process_says_it_once(capsys):
    for text in ("one", "one", "two"):
        notify(text)
    assert capsys.readouterr().err == "jerkbench: one\njerkbench: two\n"


def test_processes_that_work_together_say_it_once_between_them_and_others_anew(capsys):
    notify("b")
    with shared_notices():
        assert said_by_another() == "jerkbench: compiling a\n"
        assert said_by_another() == ""
        notify("compiling a", "a")
    assert capsys.readouterr().err == "jerkbench: b\n"
    assert said_by_another() == "jerkbench: compiling a\njerkbench: b\n"
