"""Bundles through an executor: sent in order, a few at a time, and again where a worker was lost."""

from collections import deque
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from itertools import groupby
from typing import Any, Generic, NamedTuple

from jerkbench.clusters.cluster import ClusterError, Order, Result, Task
from jerkbench.clusters.connection import Connection
from jerkbench.clusters.sending import packed, run_packed

TRIES = 3
"""So often a task may lose its worker: in its bundle, and then by itself."""
LOOK_S = 2.0
"""So long we wait for a result before the connection is asked whether one can still come."""


class _Bundle(NamedTuple, Generic[Task]):
    """Tasks that are sent together; ``tries`` of them lost their worker."""

    tasks: list[Task]
    tries: int = 0


def run_bundles(connection: Connection, order: Order[Task, Result]) -> Iterator[tuple[Task, Result | Exception]]:
    """Yield each task with its result, or with what kept it from being done.

    The tasks of a bundle that loses its worker are sent again, each by itself: the one that ends its worker is told
    apart. One that lost three is given up.

    Raises:
        ClusterError: a worker has other code than the plan, or no result can come any more.
        OSError: a result could not be stored.
    """
    try:
        yield from _Dispatch(connection, order).outcomes()
    finally:
        connection.close()


class _Dispatch(Generic[Task, Result]):
    """What waits, and what is on its way."""

    def __init__(self, connection: Connection, order: Order[Task, Result]) -> None:
        self.connection, self.order = connection, order
        whole = (list(tasks) for group in order.groups for _, tasks in groupby(group, order.bundle))
        self.waiting = deque(_Bundle(tasks) for tasks in whole)
        self.lost: deque[_Bundle[Task]] = deque()
        self.running: dict[Future[list[Any]], _Bundle[Task]] = {}
        self.broken = False

    def outcomes(self) -> Iterator[tuple[Task, Result | Exception]]:
        """Yield what comes, until nothing is left."""
        while True:
            yield from self._send()
            if not self.running:
                return
            finished, _ = wait(self.running, LOOK_S, FIRST_COMPLETED)
            for future in finished:
                yield from self._received(future)
            if not finished and (trouble := self.connection.trouble()):
                raise ClusterError(trouble)

    def _send(self) -> Iterator[tuple[Task, Result | Exception]]:
        """Send as many bundles as there is room for; what cannot even be packed comes back at once."""
        if self.broken and not self.running:
            self.connection.renew()
            self.broken = False
        while not self.broken and (bundle := self._next()) is not None:
            try:
                pack = packed(self.order.work, bundle.tasks, self.order.identity)
            except Exception as error:  # noqa: BLE001 - a plugin decides on what pickling raises
                yield from ((task, error) for task in bundle.tasks)
                continue
            try:
                self.running[self.connection.submit(run_packed, pack)] = bundle
            except BrokenExecutor:
                self.broken = True
                self.lost.append(bundle)

    def _next(self) -> _Bundle[Task] | None:
        """The next bundle that is admitted; what was lost goes last, where it breaks nothing but itself."""
        while self.waiting and len(self.running) < self.connection.room():
            if tasks := self.order.admit(self.waiting.popleft().tasks):
                return _Bundle(tasks)
        if self.lost and not self.waiting and len(self.running) < self._room_for_lost():
            return self.lost.popleft()
        return None

    def _room_for_lost(self) -> int:
        return 1 if self.connection.shared_fate else self.connection.room()

    def _received(self, future: "Future[list[Any]]") -> Iterator[tuple[Task, Result | Exception]]:
        bundle = self.running.pop(future)
        try:
            outcomes = future.result()
        except (ClusterError, CancelledError) as error:
            raise _ended(error, self.connection) from error
        except Exception as error:  # noqa: BLE001 - each engine has errors of its own for a worker that is lost
            self.broken = self.broken or isinstance(error, BrokenExecutor)
            yield from self._again(bundle, error)
            return
        for task, outcome in zip(bundle.tasks, outcomes, strict=True):
            if isinstance(outcome, OSError):  # nothing more can be stored: the sweep has to end
                raise outcome
            yield task, outcome

    def _again(self, bundle: _Bundle[Task], error: Exception) -> Iterator[tuple[Task, Result | Exception]]:
        """Let each task wait for another worker, or give it up."""
        tries = bundle.tries + 1
        if tries < TRIES:
            self.lost.extend(_Bundle([task], tries) for task in bundle.tasks)
            return
        reason = " ".join(str(error).split())
        yield from ((task, ChildProcessError(f"the process that ran it died ({reason})")) for task in bundle.tasks)


def _ended(error: BaseException, connection: Connection) -> ClusterError:
    if isinstance(error, ClusterError):
        return error
    return ClusterError(connection.trouble() or "The cluster has cancelled what was on its way.")
