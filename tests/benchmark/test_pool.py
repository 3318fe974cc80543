"""Work in processes: grouped, helping each other, surviving a death."""

import os
import time

import pytest

from jerkbench.benchmark.pool import run_grouped
from jerkbench.notices import notify


def where(task):
    time.sleep(0.2)
    return os.getpid()


def die_on_three(task):
    if task == 3:
        os._exit(1)
    return task * 10


def test_every_task_is_done_once_in_this_process_where_one_worker_is_enough():
    done = list(run_grouped(where, [[1, 2], [3]], workers=1))

    assert done == [(1, os.getpid()), (2, os.getpid()), (3, os.getpid())]


def test_two_workers_take_a_group_each_and_the_idle_one_helps():
    done = dict(run_grouped(where, [[1, 2], [11, 12, 13, 14, 15, 16, 17, 18]], workers=2))

    assert sorted(done) == [1, 2, 11, 12, 13, 14, 15, 16, 17, 18]
    assert done[1] == done[2]
    assert done[11] != done[1]
    assert len({done[task] for task in range(11, 19)}) == 2
    assert os.getpid() not in done.values()


def test_a_process_that_dies_costs_its_own_task_only():
    done = dict(run_grouped(die_on_three, [[1, 2, 3, 4], [5, 6]], workers=2))

    assert isinstance(done.pop(3), ChildProcessError)
    assert done == {1: 10, 2: 20, 4: 40, 5: 50, 6: 60}


def test_whoever_stops_early_is_told_which_processes_were_ended():
    ended = []
    done = run_grouped(where, [[1], [2, 3, 4, 5, 6, 7, 8, 9]], 2, ended.extend)
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
