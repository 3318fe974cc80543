"""Work in processes of our own: grouped, helping each other, surviving a death."""

import gc
import os
import pickle
import threading
import time
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import pytest
from threadpoolctl import threadpool_info

from jerkbench.errors import PluginError
from jerkbench.jobs.cluster import Lent, OwnPool, Workers
from jerkbench.jobs.dispatch import Order, outcomes
from jerkbench.notices import notify


def run_grouped(work, groups, workers):
    with Workers(count=workers) as own:
        yield from outcomes(Order(work, groups), own.lent(sum(map(len, groups))))


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


class Recorded(Executor):
    """Does nothing by itself.

    Attributes:
        waiting: what was submitted, by its task.
    """

    def __init__(self):
        self.waiting = {}

    def submit(self, run, pack):
        (task,) = pickle.loads(pack.content)[1]  # noqa: S301 - packed by this test
        return self.waiting.setdefault(task, Future())


def test_a_worker_keeps_its_group_and_then_helps_with_the_longest():
    executor = Recorded()
    done = outcomes(Order(where, [[1, 2], [11, 12, 13, 14], [21]]), Lent(executor, lambda: 2))
    asker = threading.Thread(target=lambda: list(done), daemon=True)
    asker.start()
    for number, task in enumerate((1, 2, 11, 12, 21, 13, 14), start=2):
        while len(executor.waiting) < min(number, 7):
            time.sleep(0.001)
        executor.waiting[task].set_result([None])
    asker.join()

    assert list(executor.waiting) == [11, 1, 2, 21, 12, 13, 14]


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
    assert len(done) == 2

    for error in done.values():
        assert isinstance(error, PluginError)
        assert "ValueError: no licence on this machine" in str(error)


def habits(task):
    return max((library["num_threads"] for library in threadpool_info()), default=1), gc.get_threshold()


def test_a_worker_has_one_thread_and_looks_for_garbage_as_seldom_as_a_command():
    done = dict(run_grouped(habits, [[1], [2]], workers=2))

    assert set(done.values()) == {(1, (50_000, 20, 100))}


def test_whoever_stops_early_has_no_process_left(tmp_path):
    with OwnPool() as pool:
        first, second, _ = [pool.submit(Meeting(tmp_path), task) for task in (1, 2, 3)]
        numbers = {first.result(), second.result()}

    assert len(numbers) == 2
    for number in numbers:
        with pytest.raises(ProcessLookupError):
            os.kill(number, 0)


@pytest.mark.parametrize("order", ["ab", "ba"])
def test_processes_that_are_free_together_go_on_with_their_own_groups(tmp_path, order):
    """Each has the recordings of its group in memory, whichever was free first."""
    with OwnPool() as pool:
        met = {group: pool.submit(Meeting(tmp_path), 1, group=group) for group in "ab"}
        process = {group: future.result() for group, future in met.items()}
        again = {group: pool.submit(Meeting(tmp_path), 1, group=group) for group in order}

        assert process["a"] != process["b"]
        assert {group: future.result() for group, future in again.items()} == process


def talk(task):
    notify("compiling something")
    return where(task)


def test_what_each_process_would_say_is_said_once(capfd, monkeypatch):
    monkeypatch.setattr("jerkbench.notices._GIVEN", set())
    done = dict(run_grouped(talk, [[1, 2, 3], [4, 5, 6]], workers=2))

    assert len(set(done.values())) == 2
    assert capfd.readouterr().err.count("compiling something") == 1
