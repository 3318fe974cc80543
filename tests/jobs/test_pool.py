"""Work in processes of this machine. A process that dies costs its own task only."""

import ctypes
import gc
import os
import time
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import pytest
from threadpoolctl import threadpool_info

from jerkbench.errors import PluginError, notify
from jerkbench.jobs.executors import LocalExecutor, Workers
from jerkbench.jobs.run import outcomes


def run(work, chunks, workers):
    with Workers(count=workers) as own:
        for tasks, result in outcomes(work, chunks, own.pool(sum(map(len, chunks)))):
            yield from ((task, result) for task in tasks)


def where(tasks):
    return len(tasks), os.getpid()


@dataclass(frozen=True)
class Meeting:
    """Work that waits until two processes have left their numbers in the folder."""

    folder: Path

    def __call__(self, tasks):
        (self.folder / str(os.getpid())).touch()
        while len(list(self.folder.iterdir())) < 2:
            time.sleep(0.01)
        return len(tasks), os.getpid()


def die_on_three(tasks):
    if 3 in tasks:
        os._exit(1)
    return len(tasks), tuple(tasks)


def test_workers_are_this_process_or_others_and_a_death_costs_its_own_task_only(tmp_path):
    assert list(run(where, [[1, 2], [3]], workers=1)) == [(task, os.getpid()) for task in (1, 2, 3)]
    done = list(run(Meeting(tmp_path), [[1, 2], [11, 12], [13]], workers=2))
    assert sorted(task for task, _ in done) == [1, 2, 11, 12, 13]
    assert len({process for _, process in done} - {os.getpid()}) == 2
    done = dict(run(die_on_three, [[1, 2, 3, 4], [5, 6]], workers=2))
    assert isinstance(done.pop(3), ChildProcessError)
    assert sorted(done) == [1, 2, 4, 5, 6]
    assert all(task in result for task, result in done.items())


def test_a_plugin_module_that_fails_in_a_worker_is_named(tmp_path, monkeypatch):
    module = "fails_elsewhere"
    (tmp_path / f"{module}.py").write_text(
        "import multiprocessing\n"
        "if multiprocessing.parent_process():\n"
        "    raise ValueError('no licence on this machine')\n"
        "def work(tasks):\n"
        "    return len(tasks), None\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("jerkbench.plugins.modules_of_user", lambda: [module])

    done = dict(run(import_module(module).work, [[1], [2]], workers=2))

    assert [type(error) for error in done.values()] == [PluginError] * 2
    assert "ValueError: no licence on this machine" in str(done[1])


def test_no_process_is_left(tmp_path):
    executor = LocalExecutor(2)
    futures = [executor.submit(Meeting(tmp_path), [task]) for task in (1, 2, 3)]
    numbers = {future.result()[1] for future in futures[:2]}
    executor.shutdown()

    assert len(numbers) == 2
    for number in numbers:
        with pytest.raises(ProcessLookupError):
            os.kill(number, 0)


def talk(tasks):
    notify("compiling something")
    return where(tasks)


def test_workers_print_a_message_once_and_have_one_thread_and_the_garbage_limits_of_a_command(capfd, monkeypatch):
    monkeypatch.setattr("jerkbench.errors._GIVEN", set())
    list(run(talk, [[1, 2, 3], [4, 5, 6]], workers=2))
    assert capfd.readouterr().err.count("compiling something") == 1
    assert set(dict(run(habits, [[1], [2]], workers=2)).values()) == {(1, (50_000, 20, 100))}


def habits(tasks):
    threads = max((library["num_threads"] for library in threadpool_info()), default=1)
    return len(tasks), (threads, gc.get_threshold())


def hold_interpreter(tasks):
    Path(tasks[0]).write_text(str(os.getpid()))
    ctypes.PyDLL(None).sleep(600)  # like compiled code that does not release the lock of the interpreter


@pytest.mark.skipif(os.name == "nt", reason="the C library has another name")
def test_a_process_that_holds_the_interpreter_is_terminated(tmp_path):
    executor = LocalExecutor(1)
    executor.submit(hold_interpreter, [tmp_path / "number"])
    while not (tmp_path / "number").exists() or not (tmp_path / "number").read_text():
        time.sleep(0.05)
    executor.shutdown()

    with pytest.raises(ProcessLookupError):
        os.kill(int((tmp_path / "number").read_text()), 0)
