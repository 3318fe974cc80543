"""Of several processes on one folder, each bundle is one's; what a dead one has locked is another's."""

import shutil
import signal
import subprocess
import sys

import filelock
import pytest

from jerkbench.jobs import run as module
from jerkbench.jobs.run import Locks

OTHER = """
import sys, pathlib
from jerkbench.jobs.run import Locks
with Locks(pathlib.Path(sys.argv[1]), "plan") as own:
    print(own.take(7), flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def two(tmp_path):
    with Locks(tmp_path / "locks", "plan") as first, Locks(tmp_path / "locks", "plan") as second:
        yield first, second


@pytest.fixture
def other(tmp_path):
    """Another process, which has locked a bundle."""
    program = [sys.executable, "-c", OTHER, str(tmp_path / "locks")]
    with subprocess.Popen(program, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "True\n"
        yield process
        process.stdin.close()


def test_one_of_two_gets_a_bundle_and_the_other_when_it_is_given_up(two):
    first, second = two

    assert [first.take(7), second.take(7), second.take(8), first.take(8)] == [True, False, True, False]
    first.release(7)
    assert second.take(7)


@pytest.mark.slow
def test_a_process_that_was_killed_has_lost_its_locks_at_once_and_leaves_nothing(other, tmp_path):
    with Locks(tmp_path / "locks", "plan") as own:
        assert not own.take(7)
        other.send_signal(signal.SIGKILL)
        other.wait()
        assert own.take(7)
    assert not (tmp_path / "locks").exists()


@pytest.mark.slow
def test_the_folder_stays_for_a_process_that_is_still_at_work(other, tmp_path):
    with Locks(tmp_path / "locks", "plan") as own:
        assert own.mark.is_file()
    with Locks(tmp_path / "locks", "plan") as own:
        assert not own.take(7)


def test_where_there_are_no_locks_everything_is_taken_and_it_is_said(two, monkeypatch):
    def refuse(*_, **__):
        raise NotImplementedError

    said = []
    monkeypatch.setattr(filelock.FileLock, "acquire", refuse)
    monkeypatch.setattr(module, "notify", said.append)
    first, second = two

    assert [first.take(9), second.take(9)] == [True, True]
    assert "can hold no locks" in said[0]


def test_a_process_that_enters_while_another_clears_the_folder_makes_it_anew(tmp_path, monkeypatch):
    taken = Locks._take

    def cleared(locks, path):
        monkeypatch.setattr(Locks, "_take", taken)
        assert taken(locks, path)
        shutil.rmtree(tmp_path / "locks")
        return True

    monkeypatch.setattr(Locks, "_take", cleared)
    with Locks(tmp_path / "locks", "plan") as own:
        assert own.mark.exists()
        assert own.take(1)
    assert not (tmp_path / "locks").exists()
