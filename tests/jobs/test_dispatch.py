"""Tasks on their way: those of a group to one worker, a few at a time, and again where a worker is lost."""

import pickle
from collections import deque
from concurrent.futures import CancelledError, Executor, Future

import pytest

from jerkbench.jobs.cluster import ClusterError, Lent
from jerkbench.jobs.dispatch import TRIES, Order, RefusedError, outcomes


class FakeExecutor(Executor):
    """An engine without processes: whoever waits makes it run the oldest bundle.

    Attributes:
        deaths: for each task, how many workers it ends.
        sent: the tasks of each bundle that was run.
    """

    def __init__(self, deaths=(), *, error=None, slots=2):
        self.deaths, self.error = dict(deaths), error
        self.sent, self.waiting, self._slots = [], deque(), slots

    def lent(self, *, elsewhere=True):
        return Lent(self, lambda: self._slots, elsewhere=elsewhere)

    def submit(self, run, pack):
        assert len(self.waiting) < self._slots
        future = Immediate(self)
        self.waiting.append((future, *pickle.loads(pack.content)))  # noqa: S301 - packed by this test
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
            future.set_result([work(task) for task in tasks])


class Immediate(Future):
    def __init__(self, executor):
        super().__init__()
        self._executor = executor

    def __hash__(self):
        return id(self)


@pytest.fixture(autouse=True)
def waiting(monkeypatch):
    """Waiting is what makes the engine run."""

    def wait(running, timeout, return_when):
        executor = next(iter(running))._executor
        if not any(future.done() for future in running):
            executor.run_oldest()
        return {future for future in running if future.done()}, None

    monkeypatch.setattr("jerkbench.jobs.dispatch.wait", wait)


def tenfold(task):
    return task * 10


def order(groups, work=tenfold, admit=list):
    return Order(work, groups, lambda task: task // 10, admit)


def test_a_bundle_is_a_stretch_of_its_group_and_goes_as_a_whole():
    executor = FakeExecutor()
    done = list(outcomes(order([[1, 2, 11, 12], [13, 21]]), executor.lent()))

    assert executor.sent == [[1, 2], [13], [11, 12], [21]]
    assert done == [(task, task * 10) for task in (1, 2, 13, 11, 12, 21)]


def test_what_is_not_admitted_is_left_out():
    executor = FakeExecutor()
    done = dict(
        outcomes(order([[1, 2, 11]], admit=lambda tasks: [task for task in tasks if task > 1]), executor.lent())
    )

    assert done == {2: 20, 11: 110}


def test_a_lost_bundle_is_sent_again_task_by_task():
    executor = FakeExecutor({2: 1})
    done = dict(outcomes(order([[1, 2, 3], [11]]), executor.lent()))

    assert done == {task: task * 10 for task in (1, 2, 3, 11)}
    assert executor.sent == [[1, 2, 3], [11], [1], [2], [3]]


def test_a_task_that_ends_each_worker_is_given_up_and_the_others_are_done():
    executor = FakeExecutor({2: 99})
    done = dict(outcomes(order([[1, 2, 3], [11]]), executor.lent()))

    assert "died (killed)" in str(done.pop(2))
    assert done == {task: task * 10 for task in (1, 3, 11)}
    assert sum(2 in bundle for bundle in executor.sent) == TRIES


@pytest.mark.parametrize("error", [RefusedError("other code"), CancelledError()])
def test_a_worker_that_refuses_and_a_cluster_that_is_gone_end_the_sweep_in_a_sentence(error):
    executor = FakeExecutor(error=error)
    with pytest.raises(ClusterError, match=r"other code|has cancelled"):
        list(outcomes(order([[1], [11]]), executor.lent()))


def test_what_a_worker_has_not_come_to_is_sent_again(monkeypatch):
    monkeypatch.setattr("jerkbench.jobs.dispatch.BUNDLE_S", 0.0)
    executor = FakeExecutor()
    monkeypatch.setattr(executor, "submit", lambda run, pack: done_at_once(executor, run, pack))

    assert list(outcomes(order([[1, 2], [11]]), executor.lent())) == [(1, 10), (11, 110), (2, 20)]
    assert executor.sent == [[1, 2], [11], [2]]


def test_two_workers_may_go_on_with_what_one_has_not_come_to(monkeypatch):
    monkeypatch.setattr("jerkbench.jobs.dispatch.BUNDLE_S", 0.0)
    executor = FakeExecutor(slots=1)
    monkeypatch.setattr(executor, "submit", lambda run, pack: done_at_once(executor, run, pack))

    assert [task for task, _ in outcomes(order([[1, 2, 3, 4, 5, 6]]), executor.lent())] == [1, 2, 3, 4, 5, 6]
    assert executor.sent == [[1, 2, 3, 4, 5, 6], [2, 3], [3], [4, 5, 6], [5], [6]]


class Unpackable(int):
    def __reduce__(self):
        raise TypeError("it holds a file")


def test_what_cannot_be_packed_costs_the_others_of_its_bundle_nothing():
    done = dict(outcomes(order([[1, Unpackable(2), 3]]), FakeExecutor().lent()))

    assert str(done.pop(2)) == "it holds a file"
    assert done == {1: 10, 3: 30}


def test_the_rest_of_a_task_is_sent_again():
    executor = FakeExecutor()
    twice = Order(tenfold, [[1], [11]], rest=lambda result: 2 if result == 10 else None)

    assert sorted(outcomes(twice, executor.lent())) == [(1, 10), (2, 20), (11, 110)]
    assert executor.sent == [[1], [11], [2]]


def test_what_is_next_is_sent_before_a_result_is_handed_on():
    """A worker does not wait until somebody has stored what it has found."""
    executor = FakeExecutor(slots=1)
    for task, _ in outcomes(order([[1, 11, 21]]), executor.lent()):
        assert len(executor.waiting) == (task != 21)


def done_at_once(executor, run, pack):
    future = Immediate(executor)
    executor.sent.append(pickle.loads(pack.content)[1])  # noqa: S301 - packed by this test
    future.set_result(run(pack))
    return future


def test_what_cannot_be_sent_is_told_of_each_task():
    executor = FakeExecutor()
    done = dict(outcomes(order([[1, 2]], lambda task: task), executor.lent()))

    assert executor.sent == []
    assert {type(error).__name__ for error in done.values()} <= {"PicklingError", "AttributeError"}
    assert set(done) == {1, 2}
