"""Chunks of tasks when workers end, and the progress of a sweep."""

import pickle
import re
import time
from collections import deque
from concurrent.futures import CancelledError, Executor, Future

import pytest

from jerkbench.jobs import progress as progress_module
from jerkbench.jobs.executors import ClusterError, Pool
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.run import outcomes, run_chunk


class FakeExecutor(Executor):
    """An executor without processes; waiting runs the oldest chunk. ``deaths``: how many workers each task ends."""

    def __init__(self, deaths=(), *, error=None):
        self.deaths, self.error, self.sent, self.waiting = dict(deaths), error, [], deque()

    def submit(self, run, content, *rest):
        future = Immediate(self)
        self.waiting.append((future, *pickle.loads(content)))  # noqa: S301 - packed by this test
        return future

    def run_oldest(self):
        future, work, tasks = self.waiting.popleft()
        self.sent.append(tasks)
        if self.error:
            future.set_exception(self.error)
        elif culprit := next((task for task in tasks if self.deaths.get(task, 0) > 0), None):
            self.deaths[culprit] -= 1
            future.set_exception(RuntimeError("killed"))
        else:
            future.set_result(work(tasks))


class Immediate(Future):
    def __init__(self, executor):
        super().__init__()
        self.executor = executor

    def __hash__(self):
        return id(self)


@pytest.fixture(autouse=True)
def waiting(monkeypatch):
    def wait(running, timeout, return_when):
        if running:
            next(iter(running)).executor.run_oldest()
        return {future for future in running if future.done()}, None

    monkeypatch.setattr("jerkbench.jobs.run.wait", wait)


def tenfold(tasks):
    return len(tasks), [task * 10 for task in tasks]


def only_two(tasks):
    return tenfold(tasks[:2])


def done(chunks, executor, work=tenfold, slots=2):
    found = {}
    for tasks, result in outcomes(work, chunks, Pool(executor, lambda: slots)):
        found |= (
            dict.fromkeys(tasks, result) if isinstance(result, Exception) else dict(zip(tasks, result, strict=True))
        )
    return found


@pytest.mark.parametrize("pool", [None, Pool(FakeExecutor(), lambda: 1)])
def test_the_rest_of_a_chunk_is_run_again(pool):
    found = [(tuple(tasks), result) for tasks, result in outcomes(only_two, [[1, 2, 3, 4, 5], [6]], pool)]

    assert sorted(task for tasks, _ in found for task in tasks) == [1, 2, 3, 4, 5, 6]
    assert all(result == [10 * task for task in tasks] for tasks, result in found)


@pytest.mark.parametrize(("deaths", "sent"), [(1, []), (2, [[3], [2], [1]])])
def test_a_chunk_that_loses_its_worker_is_run_alone_and_then_task_by_task(deaths, sent):
    executor = FakeExecutor({2: deaths})

    assert done([[1, 2, 3], [11]], executor) == {task: task * 10 for task in (1, 2, 3, 11)}
    assert executor.sent == [[1, 2, 3], [11], [1, 2, 3], *sent]


@pytest.mark.parametrize("error", [ClusterError("different code"), CancelledError()])
def test_a_worker_that_refuses_and_a_cluster_that_is_gone_end_the_sweep(error):
    with pytest.raises(ClusterError, match=r"different code|has cancelled"):
        done([[1], [11]], FakeExecutor(error=error))


class Unpackable(int):
    def __reduce__(self):
        raise TypeError("it holds a file")


def test_what_cannot_run_costs_the_others_nothing_or_ends_the_sweep(monkeypatch):
    monkeypatch.setattr("jerkbench.jobs.run.MAX_FIRST_DEATHS", 10)
    found = done([[1, Unpackable(2), 3]], FakeExecutor())
    assert str(found.pop(2)) == "it holds a file"
    assert found == {1: 10, 3: 30}
    with pytest.raises(ClusterError, match="another version of jerkbench"):
        run_chunk(b"no pickle", "", (), ("0" * 64, ()))
    with pytest.raises(ClusterError, match="end before they return a result"):
        done([[task] for task in range(20)], FakeExecutor(error=RuntimeError("no memory")))


def test_what_is_left_is_counted_and_without_anything_left_there_is_no_bar(capsys):
    progress = Progress(4)
    progress.skip(1)
    with progress:
        for _ in range(3):
            progress.advance(["ok", "diverged"])
    err = capsys.readouterr().err
    for line in ("1 of 4 combinations are already complete.", "3/3 combinations", "3 runs diverged"):
        assert line in err
    progress = Progress(3)
    progress.skip(3)
    with progress:
        pass
    assert capsys.readouterr().err == "3 of 3 combinations are already complete.\n"


def test_a_pipe_hears_how_far_it_is(capsys, monkeypatch):
    monkeypatch.setattr(progress_module, "FIRST_S", 0.01)
    monkeypatch.setattr(progress_module, "EVERY_S", 0.01)
    with Progress(4) as progress:
        progress.advance(["diverged"])
        err = ""
        while not (line := re.search("Sweep: 1 of 4 combinations after .*", err)):
            time.sleep(0.01)
            err += capsys.readouterr().err
    assert line[0].endswith("left; 1 runs diverged.")
