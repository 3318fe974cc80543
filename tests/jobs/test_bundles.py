"""Bundles through an executor: in order, a few at a time, and again where a worker is lost."""

import pickle
from collections import deque
from concurrent.futures import CancelledError, Future

import pytest

from jerkbench.jobs.bundles import TRIES, RefusedError, run_bundles
from jerkbench.jobs.cluster import ClusterError, Order
from jerkbench.jobs.identity import Identity


class FakeConnection:
    """An engine without processes: whoever waits makes it run the oldest bundle.

    Attributes:
        deaths: for each task, how many workers it ends.
        sent: the tasks of each bundle that was run.
    """

    def __init__(self, deaths=(), *, error=None, room=2):
        self.deaths, self.error = dict(deaths), error
        self.sent, self.waiting, self._room, self.closed = [], deque(), room, False

    def submit(self, run, pack):
        assert len(self.waiting) < self._room
        future = Immediate(self)
        self.waiting.append((future, *pickle.loads(pack.content)))  # noqa: S301 - packed by this test
        return future

    def room(self):
        return self._room

    def trouble(self):
        return ""

    def close(self):
        self.closed = True

    def run_oldest(self):
        future, work, tasks = self.waiting.popleft()
        self.sent.append(tasks)
        if self.error:
            future.set_exception(self.error)
        elif culprit := next((task for task in tasks if self.deaths.get(task, 0) > 0), None):
            self.deaths[culprit] -= 1
            future.set_exception(RuntimeError("killed"))
        else:
            future.set_result([work(task) for task in tasks])


class Immediate(Future):
    def __init__(self, connection):
        super().__init__()
        self._connection = connection

    def __hash__(self):
        return id(self)


@pytest.fixture(autouse=True)
def waiting(monkeypatch):
    """Waiting is what makes the engine run."""

    def wait(running, timeout, return_when):
        connection = next(iter(running))._connection
        if not any(future.done() for future in running):
            connection.run_oldest()
        return {future for future in running if future.done()}, None

    monkeypatch.setattr("jerkbench.jobs.bundles.wait", wait)


def tenfold(task):
    return task * 10


def full(task):
    return OSError(28, "No space left on device")


def order(groups, work=tenfold, admit=list):
    return Order(work, groups, lambda task: task // 10, admit, Identity("", ()), lambda numbers: None)


def test_a_bundle_is_a_stretch_of_its_group_and_goes_as_a_whole():
    connection = FakeConnection()
    done = list(run_bundles(connection, order([[1, 2, 11, 12], [13, 21]])))

    assert connection.sent == [[1, 2], [11, 12], [13], [21]]
    assert done == [(task, task * 10) for task in (1, 2, 11, 12, 13, 21)]
    assert connection.closed


def test_what_is_not_admitted_is_left_out():
    connection = FakeConnection()
    done = dict(run_bundles(connection, order([[1, 2, 11]], admit=lambda tasks: [task for task in tasks if task > 1])))

    assert done == {2: 20, 11: 110}


def test_a_lost_bundle_is_sent_again_task_by_task():
    connection = FakeConnection({2: 1})
    done = dict(run_bundles(connection, order([[1, 2, 3], [11]])))

    assert done == {task: task * 10 for task in (1, 2, 3, 11)}
    assert connection.sent == [[1, 2, 3], [11], [1], [2], [3]]


def test_a_task_that_ends_each_worker_is_given_up_and_the_others_are_done():
    connection = FakeConnection({2: 99})
    done = dict(run_bundles(connection, order([[1, 2, 3], [11]])))

    assert "died (killed)" in str(done.pop(2))
    assert done == {task: task * 10 for task in (1, 3, 11)}
    assert sum(2 in bundle for bundle in connection.sent) == TRIES


@pytest.mark.parametrize("error", [RefusedError("other code"), CancelledError()])
def test_a_worker_that_refuses_and_a_cluster_that_is_gone_end_the_sweep_in_a_sentence(error):
    connection = FakeConnection(error=error)
    with pytest.raises(ClusterError, match=r"other code|has cancelled"):
        list(run_bundles(connection, order([[1], [11]])))
    assert connection.closed


def test_a_result_that_cannot_be_stored_ends_the_sweep():
    with pytest.raises(OSError, match="No space left"):
        list(run_bundles(FakeConnection(), order([[1]], full)))


def test_what_cannot_be_sent_is_told_of_each_task():
    connection = FakeConnection()
    done = dict(run_bundles(connection, order([[1, 2]], lambda task: task)))

    assert connection.sent == []
    assert {type(error).__name__ for error in done.values()} <= {"PicklingError", "AttributeError"}
    assert set(done) == {1, 2}
