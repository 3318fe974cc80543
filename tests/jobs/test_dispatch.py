"""Chunks of tasks come back complete, whatever happens to the workers."""

import pickle
from collections import deque
from concurrent.futures import CancelledError, Executor, Future

import pytest

from jerkbench.jobs.executors import ClusterError, Pool
from jerkbench.jobs.run import MAX_DEATHS, outcomes, run_chunk


class FakeExecutor(Executor):
    """An executor without processes. Waiting makes it run the oldest chunk.

    Attributes:
        deaths: how many workers each task ends.
        sent: the tasks of each chunk that was run.
    """

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


def test_every_task_is_done_once():
    executor = FakeExecutor()

    assert done([[1, 2], [3], [4, 5]], executor) == {task: task * 10 for task in range(1, 6)}
    assert executor.sent == [[1, 2], [3], [4, 5]]


@pytest.mark.parametrize("pool", [None, Pool(FakeExecutor(), lambda: 1)])
def test_the_rest_of_a_chunk_is_run_again(pool):
    found = [(tuple(tasks), result) for tasks, result in outcomes(only_two, [[1, 2, 3, 4, 5], [6]], pool)]

    assert sorted(task for tasks, _ in found for task in tasks) == [1, 2, 3, 4, 5, 6]
    assert all(result == [10 * task for task in tasks] for tasks, result in found)


def test_two_workers_share_the_rest_of_the_last_chunk():
    executor = FakeExecutor()

    assert done([[1, 2, 3, 4, 5, 6]], executor, only_two) == {task: task * 10 for task in range(1, 7)}
    assert executor.sent == [[1, 2, 3, 4, 5, 6], [3, 4], [5, 6]]


@pytest.mark.parametrize(("deaths", "sent"), [(1, []), (2, [[3], [2], [1]])])
def test_a_chunk_that_loses_its_worker_is_run_alone_and_then_task_by_task(deaths, sent):
    executor = FakeExecutor({2: deaths})

    assert done([[1, 2, 3], [11]], executor) == {task: task * 10 for task in (1, 2, 3, 11)}
    assert executor.sent == [[1, 2, 3], [11], [1, 2, 3], *sent]


def test_workers_that_never_return_anything_end_the_sweep():
    with pytest.raises(ClusterError, match="end before they return anything"):
        done([[task] for task in range(200)], FakeExecutor(error=RuntimeError("no memory")))


def test_a_task_that_ends_each_worker_is_given_up_and_the_others_are_done():
    executor = FakeExecutor({2: 99})
    found = done([[1, 2, 3], [11]], executor)

    assert str(found.pop(2)) == "its worker process died (killed)"
    assert found == {task: task * 10 for task in (1, 3, 11)}
    assert sum(2 in chunk for chunk in executor.sent) == MAX_DEATHS


@pytest.mark.parametrize("error", [ClusterError("different code"), CancelledError()])
def test_a_worker_that_refuses_and_a_cluster_that_is_gone_end_the_sweep(error):
    with pytest.raises(ClusterError, match=r"different code|has cancelled"):
        done([[1], [11]], FakeExecutor(error=error))


class Unpackable(int):
    def __reduce__(self):
        raise TypeError("it holds a file")


def test_a_task_that_cannot_be_pickled_costs_the_others_of_its_chunk_nothing():
    found = done([[1, Unpackable(2), 3]], FakeExecutor())

    assert str(found.pop(2)) == "it holds a file"
    assert found == {1: 10, 3: 30}


def test_a_worker_with_different_code_does_not_read_its_tasks():
    with pytest.raises(ClusterError, match="another version of jerkbench"):
        run_chunk(b"no pickle", "", (), ("0" * 64, ()))
