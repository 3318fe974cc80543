"""Bundles through an executor: sent in order, a few at a time, and again where a worker was lost."""

import os
import pickle
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from dataclasses import dataclass
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Any, Generic, NamedTuple, Protocol

from jerkbench.errors import JerkbenchError
from jerkbench.jobs.cluster import ClusterError, Order, Result, Task
from jerkbench.jobs.identity import Identity, refusal
from jerkbench.plain import keep_output_plain

TRIES = 3
"""So often a task may lose its worker: in its bundle, and then by itself."""
LOOK_S = 2.0
"""So long we wait for a result before the connection is asked whether one can still come."""


class Connection(Protocol):
    """An engine that takes bundles, opened."""

    def submit(self, work: Callable[..., Any], *arguments: Any) -> "Future[Any]":  # noqa: ANN401 - goes to the work
        """Hand over a piece of work."""
        ...

    def room(self) -> int:
        """Return how many bundles may be on their way: one that runs and one that waits for each worker."""
        ...

    def trouble(self) -> str:
        """Return why no result will come any more, or an empty string."""
        ...

    def close(self) -> None:
        """Cancel what waits; what runs is not wanted any more."""
        ...


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
        while (bundle := self._next()) is not None:
            try:
                pack = packed(self.order.work, bundle.tasks, self.order.identity)
            except Exception as error:  # noqa: BLE001 - a plugin decides on what pickling raises
                yield from ((task, error) for task in bundle.tasks)
                continue
            self.running[self.connection.submit(run_packed, pack)] = bundle

    def _next(self) -> _Bundle[Task] | None:
        """The next bundle that is admitted; what was lost goes last."""
        while self.waiting and len(self.running) < self.connection.room():
            if tasks := self.order.admit(self.waiting.popleft().tasks):
                return _Bundle(tasks)
        room = not self.waiting and len(self.running) < self.connection.room()
        return self.lost.popleft() if self.lost and room else None

    def _received(self, future: "Future[list[Any]]") -> Iterator[tuple[Task, Result | Exception]]:
        bundle = self.running.pop(future)
        try:
            outcomes = future.result()
        except (ClusterError, CancelledError) as error:
            raise _ended(error, self.connection) from error
        except Exception as error:  # noqa: BLE001 - each engine has errors of its own for a worker that is lost
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


class RefusedError(ClusterError):
    """A worker that has other code, versions or plugins than the plan."""


@dataclass(frozen=True)
class Pack:
    """A bundle as it is sent; nothing of it is read before the identity is the worker's own.

    Attributes:
        identity: what the worker must have.
        folder: working directory of the plan; a worker that has it too works there.
        content: the work and its tasks, pickled.
    """

    identity: Identity
    folder: str
    content: bytes


def packed(work: Callable[[Task], Result], tasks: Sequence[Task], identity: Identity) -> Pack:
    """Pack some tasks.

    Raises:
        Exception: they cannot be pickled; a plugin decides on what is raised.
    """
    return Pack(identity, str(Path.cwd()), pickle.dumps((work, list(tasks))))


def run_packed(pack: Pack) -> list[Any]:
    """Run the tasks of a bundle, in a worker; returns the result of each, or what it raised.

    Raises:
        RefusedError: this worker is not fit for the plan.
    """
    if sentence := refusal(pack.identity):
        raise RefusedError(sentence)
    _prepare(pack.folder)
    work, tasks = pickle.loads(pack.content)  # noqa: S301 - from the process that planned, by way of its own cluster
    return [_outcome(work, task) for task in tasks]


def _outcome(work: Callable[[Task], Result], task: Task) -> Result | Exception:
    """What came of a task; errors of anybody's own classes as text, which can always be sent."""
    try:
        return work(task)
    except (JerkbenchError, OSError) as error:
        return error
    except Exception as error:  # noqa: BLE001 - whatever a plugin raises becomes failed rows
        return ChildProcessError(f"{type(error).__name__}: {error}")


@cache
def _prepare(folder: str) -> None:
    """One thread a process, as in the own pool, and the plan's working directory: paths may be relative to it."""
    from threadpoolctl import threadpool_limits

    keep_output_plain()
    threadpool_limits(1)
    if Path(folder).is_dir():
        os.chdir(folder)
