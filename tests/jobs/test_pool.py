"""Work in processes: grouped, helping each other, surviving a death."""

import os
import time
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import pytest

from jerkbench.errors import PluginError
from jerkbench.jobs.pool import Groups, run_grouped
from jerkbench.notices import notify


def where(task):
    return os.getpid()


@dataclass(frozen=True)
class Meeting:
    """Work that is done only while another process does some: each task waits until two processes have come.

    Attributes:
        folder: where each process leaves its number.
    """

    folder: Path

    def __call__(self, task):
        (self.folder / str(os.getpid())).touch()
        while len(list(self.folder.iterdir())) < 2:
            time.sleep(0.01)
        return os.getpid()


def die_on_three(task):
    if task == 3:
        os._exit(1)
    return task * 10


def test_every_task_is_done_once_in_this_process_where_one_worker_is_enough():
    done = list(run_grouped(where, [[1, 2], [3]], workers=1))

    assert done == [(1, os.getpid()), (2, os.getpid()), (3, os.getpid())]


def test_every_task_is_done_once_and_in_another_process(tmp_path):
    """Each of two workers has one: the first waits for the second."""
    done = list(run_grouped(Meeting(tmp_path), [[1, 2], [11, 12, 13, 14]], workers=2))

    assert sorted(task for task, _ in done) == [1, 2, 11, 12, 13, 14]
    assert len({process for _, process in done}) == 2
    assert os.getpid() not in {process for _, process in done}


def test_a_worker_keeps_its_group_and_then_helps_with_the_longest():
    groups = Groups([[1, 2], [11, 12, 13, 14], [21]], workers=2)
    asked = (0, 1, 1, 0, 1, 1, 0, 0, 1)

    assert [groups.next_task(worker) for worker in asked] == [11, 1, 2, 12, 21, 13, 14, None, None]


def test_a_process_that_dies_costs_its_own_task_only():
    done = dict(run_grouped(die_on_three, [[1, 2, 3, 4], [5, 6]], workers=2))

    assert isinstance(done.pop(3), ChildProcessError)
    assert done == {1: 10, 2: 20, 4: 40, 5: 50, 6: 60}


def test_a_module_of_plugins_that_fails_in_another_process_is_no_death(tmp_path, monkeypatch):
    module = "fails_elsewhere"
    (tmp_path / f"{module}.py").write_text(
        "import multiprocessing\n"
        "if multiprocessing.parent_process():\n"
        "    raise ValueError('no licence on this machine')\n"
        "def work(task):\n"
        "    return task\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("jerkbench.plugins.modules_of_user", lambda: [module])

    done = dict(run_grouped(import_module(module).work, [[1], [2]], workers=2))

    for error in done.values():
        assert isinstance(error, PluginError)
        assert "ValueError: no licence on this machine" in str(error)


def test_whoever_stops_early_is_told_which_processes_were_ended(tmp_path):
    ended = []
    done = run_grouped(Meeting(tmp_path), [[1], [2, 3, 4, 5, 6, 7, 8, 9]], 2, ended.extend)
    first = next(done)[1]
    done.close()

    assert len(ended) == 2
    assert first in ended
    for number in ended:
        with pytest.raises(ProcessLookupError):
            os.kill(number, 0)


def talk(task):
    notify("compiling something")
    return where(task)


def test_what_each_process_would_say_is_said_once(capfd, monkeypatch):
    monkeypatch.setattr("jerkbench.notices._GIVEN", set())
    done = dict(run_grouped(talk, [[1, 2, 3], [4, 5, 6]], workers=2))

    assert len(set(done.values())) == 2
    assert capfd.readouterr().err.count("compiling something") == 1
