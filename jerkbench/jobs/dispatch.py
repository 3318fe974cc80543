"""Tasks on their way to workers: those of one group to one worker, and again where a worker was lost.

A worker elsewhere runs nothing before it has shown that its code is that of the plan.
"""

import gc
import importlib
import os
import pickle
import socket
import time
from collections import deque
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from dataclasses import dataclass
from functools import cache
from itertools import groupby
from operator import attrgetter
from pathlib import Path
from typing import Any, Generic, NamedTuple, TypeVar

from jerkbench.errors import JerkbenchError
from jerkbench.jobs.cluster import ClusterError, Lent, OwnPool, Workers
from jerkbench.jobs.job import Job
from jerkbench.jobs.key import code_digest, plugin_digest, versions
from jerkbench.notices import keep_output_plain
from jerkbench.plugins import is_own

# The identity of a plan's code: what a worker must have before it runs anything of the plan.

SENT = ("audit", "jobs", "suite", "tuning")
"""Rooms whose objects are sent to workers, besides those that compute."""


class Foreign(NamedTuple):
    """A plugin from elsewhere.

    Attributes:
        name: kind and name, for sentences.
        module: where its class is.
        qualname: what the class is called there.
        digest: hash of all that it depends on.
    """

    name: str
    module: str
    qualname: str
    digest: str


@dataclass(frozen=True)
class Identity:
    """The code, the versions of libraries and the plugins from elsewhere that a plan was made with.

    Attributes:
        code: hash of ours.
        versions: of the libraries.
        plugins: those from elsewhere.
    """

    code: str
    versions: tuple[tuple[str, str], ...]
    plugins: tuple[Foreign, ...] = ()


def identity_of(jobs: Iterable[Job]) -> Identity:
    """Return what a worker must have to run ``jobs``."""
    parts = ((f"{kind} {name}", type(plugin)) for job in jobs for kind, name, plugin in job.parts())
    classes: set[tuple[str, Any]] = {(name, cls) for name, cls in parts if not is_own(cls)}
    foreign = sorted(Foreign(name, cls.__module__, cls.__qualname__, plugin_digest(cls)) for name, cls in classes)
    return Identity(code_digest(*SENT), tuple(versions().items()), tuple(foreign))


@cache
def worker_refusal(identity: Identity) -> str:
    """Return why this process may not run what belongs to ``identity``, or an empty string."""
    host, own, code = socket.gethostname(), versions(), code_digest(*SENT)
    differing = [(name, own.get(name, "missing"), wanted) for name, wanted in identity.versions]
    if unlike := [f"{name} {there} for {wanted}" for name, there, wanted in differing if there != wanted]:
        return f"The worker on {host} has {', '.join(unlike)}; install the plan's versions there."
    if identity.code != code:
        return (
            f"The worker on {host} has other code of jerkbench (hash {code[:12]}) than the plan "
            f"({identity.code[:12]}); install the same there."
        )
    return next((sentence for foreign in identity.plugins if (sentence := _lacking(foreign, host))), "")


def _lacking(foreign: Foreign, host: str) -> str:
    """Say that a plugin is missing here, or is another."""
    try:
        cls = attrgetter(foreign.qualname)(importlib.import_module(foreign.module))
    except Exception as error:  # noqa: BLE001 - whatever a third party's module raises
        return (
            f"The worker on {host} lacks the {foreign.name} ({foreign.module}): {type(error).__name__}: {error}. "
            "Install its package there as well."
        )
    if plugin_digest(cls) != foreign.digest:
        return f"The worker on {host} has another version of the {foreign.name} ({foreign.module}); install the same."
    return ""


_Task = TypeVar("_Task")
_Result = TypeVar("_Result")

TRIES = 3
"""So often a task may lose its worker: in its bundle, and then by itself."""
LOOK_S = 2.0
"""So long we wait for a result before it is asked whether one can still come."""
BUNDLE_S = 2.0
"""So long a worker goes on with a bundle before it gives back what it has: so much is lost with it."""


@dataclass(frozen=True)
class Order(Generic[_Task, _Result]):
    """The work of a round.

    Attributes:
        work: what is done with a task.
        groups: tasks that share their recordings, together.
        bundle: names the stretch of its group that a task belongs to.
        admit: is given tasks of one bundle when their turn has come, and returns those that are to be done.
        rest: what is left of a task after a result of it; None: nothing.
        alone: the parts of a task of which one may be the culprit where its worker is lost.
        identity: code, versions and plugins that a worker elsewhere must have.
    """

    work: Callable[[_Task], _Result]
    groups: Sequence[Sequence[_Task]]
    bundle: Callable[[_Task], Hashable] = id
    admit: Callable[[Sequence[_Task]], list[_Task]] = list
    rest: Callable[[_Result], _Task | None] = lambda _: None
    alone: Callable[[_Task], list[_Task]] = lambda task: [task]
    identity: Callable[[], Identity] = lambda: identity_of(())


def outcomes(order: Order[_Task, _Result], lent: Lent | None) -> Iterator[tuple[_Task, _Result | Exception]]:
    """Yield each task with its result as it is done, or with what kept it from being done.

    The tasks of a bundle that loses its worker are sent again, each part by itself: the one that ends its worker is
    told apart. One that lost three is given up.

    Args:
        order: what is to be done.
        lent: who does it; None: this process, where what is raised is raised.

    Raises:
        ClusterError: a worker has other code than the plan, or no result can come any more.
    """
    if lent is not None:
        yield from _Dispatch(order, lent).outcomes()
        return
    for group in order.groups:
        for first in group:
            task: _Task | None = first
            while task is not None and order.admit([task]):
                result = order.work(task)
                yield task, result
                task = order.rest(result)


def each_result(
    work: Callable[[_Task], _Result], tasks: Sequence[_Task], workers: Workers
) -> Iterator[tuple[_Task, _Result]]:
    """Yield each task with its result as it is done; whatever is wrong with one of them is raised."""
    for task, result in outcomes(Order(work, [[task] for task in tasks]), workers.lent(len(tasks))):
        if isinstance(result, Exception):
            raise result
        yield task, result


class _Bundle(NamedTuple, Generic[_Task]):
    """Tasks that are sent together; ``tries`` of them lost their worker."""

    tasks: list[_Task]
    tries: int = 0


class _Dispatch(Generic[_Task, _Result]):
    """What waits, and what is on its way."""

    def __init__(self, order: Order[_Task, _Result], lent: Lent) -> None:
        self.order, self.lent = order, lent
        self.groups = [deque(_Bundle(list(own)) for _, own in groupby(group, order.bundle)) for group in order.groups]
        self.lost: deque[_Bundle[_Task]] = deque()
        self.running: dict[Future[list[Any]], tuple[_Bundle[_Task], deque[_Bundle[_Task]]]] = {}
        self.freed: list[deque[_Bundle[_Task]]] = []

    def outcomes(self) -> Iterator[tuple[_Task, _Result | Exception]]:
        """Yield what comes, until nothing is left."""
        try:
            while True:
                yield from self._send()
                if not self.running:
                    return
                finished, _ = wait(self.running, LOOK_S, FIRST_COMPLETED)
                for future in finished:
                    received = list(self._received(future))
                    yield from self._send()  # first: no worker waits until these are stored
                    yield from received
                if not finished and (trouble := self.lent.trouble()):
                    raise ClusterError(trouble)
        finally:
            for future in self.running if not self.lent.trouble() else ():
                future.cancel()

    def _send(self) -> Iterator[tuple[_Task, _Result | Exception]]:
        """Send as many bundles as there is room for; what cannot even be packed comes back at once."""
        while len(self.running) < self.lent.slots() and (group := self._group()) is not None:
            bundle = group.popleft()
            if group is not self.lost:
                bundle = bundle._replace(tasks=self.order.admit(bundle.tasks))
            if not bundle.tasks:
                continue
            try:
                identity = self.order.identity() if self.lent.elsewhere else None
                parcel = Parcel(identity, str(Path.cwd()), pickle.dumps((self.order.work, bundle.tasks)))
            except Exception as error:  # noqa: BLE001 - a plugin decides on what pickling raises
                yield from self._failed(bundle.tasks, error)
                continue
            near = {"group": id(group)} if isinstance(self.lent.executor, OwnPool) else {}
            try:
                future = self.lent.executor.submit(run_packed, parcel, **near)
            except Exception as error:
                if trouble := self.lent.trouble():
                    raise ClusterError(trouble) from error
                raise
            self.running[future] = bundle, group

    def _group(self) -> deque[_Bundle[_Task]] | None:
        """Whose turn it is: the group of which a worker has just done some, one that nobody has, or the longest."""
        last = self.freed.pop() if self.freed else None
        if last:
            return last
        at_work = {id(group) for _, group in self.running.values()}
        left = [group for group in self.groups if group]
        untouched = [group for group in left if id(group) not in at_work]
        return max(untouched or left, key=len, default=self.lost or None)

    def _received(self, future: "Future[list[Any]]") -> Iterator[tuple[_Task, _Result | Exception]]:
        bundle, group = self.running.pop(future)
        self.freed = [] if group is self.lost else [group]
        try:
            results = future.result()
        except ClusterError:
            raise
        except CancelledError as error:
            trouble = self.lent.trouble() or "The cluster has cancelled what was on its way."
            raise ClusterError(trouble) from error
        except JerkbenchError as error:
            yield from self._failed(bundle.tasks, error)
            return
        except Exception as error:  # noqa: BLE001 - each engine has errors of its own for a worker that is lost
            yield from self._again(bundle, error)
            return
        rests = [self.order.rest(result) for result in results if not isinstance(result, Exception)]
        left = [*(rest for rest in rests if rest is not None), *bundle.tasks[len(results) :]]
        for half in (left[len(left) // 2 :], left[: len(left) // 2]):  # two workers may go on with it
            group.extendleft([_Bundle(half)] if half else ())
        for task, result in zip(bundle.tasks, results, strict=False):
            if isinstance(result, Exception):
                yield from self._failed([task], result)
            else:
                yield task, result

    def _failed(self, tasks: Sequence[_Task], error: Exception) -> Iterator[tuple[_Task, Exception]]:
        """Yield a task that raised something; each of several parts is sent again alone, which tells the culprit."""
        parts = [part for task in tasks for part in self.order.alone(task)]
        if len(parts) > 1:
            self.lost.extend(_Bundle([part]) for part in parts)
        else:
            yield tasks[0], error

    def _again(self, bundle: _Bundle[_Task], error: Exception) -> Iterator[tuple[_Task, _Result | Exception]]:
        """Let each part of each task wait for another worker, or give it up."""
        tries = bundle.tries + 1
        if tries < TRIES:
            self.lost.extend(_Bundle([part], tries) for task in bundle.tasks for part in self.order.alone(task))
            return
        died = "the process that ran it died"
        said = " ".join(str(error).split())
        reason = died if said == died else f"{died} ({said})"
        yield from ((task, ChildProcessError(reason)) for task in bundle.tasks)


class RefusedError(ClusterError):
    """A worker that has other code, versions or plugins than the plan."""


@dataclass(frozen=True)
class Parcel:
    """A bundle as it is sent; nothing of it is read before the identity is the worker's own.

    Attributes:
        identity: what the worker must have; None: it is one of ours.
        folder: working directory of the plan; a worker that has it too works there.
        content: the work and its tasks, pickled.
    """

    identity: Identity | None
    folder: str
    content: bytes


def run_packed(parcel: Parcel) -> list[Any]:
    """Run the tasks of a bundle, in a worker; returns the result of each, or what it raised.

    Where the time is up they are those of the first tasks only.

    Raises:
        RefusedError: this worker is not fit for the plan.
    """
    if parcel.identity and (sentence := worker_refusal(parcel.identity)):
        raise RefusedError(sentence)
    _prepare(parcel.folder)
    work, tasks = pickle.loads(parcel.content)  # noqa: S301 - from the process that planned, by way of its own cluster
    results: list[Any] = []
    begun = time.monotonic()
    for task in tasks:
        try:
            results.append(work(task))
        except JerkbenchError as error:
            results.append(error)
        except Exception as error:  # noqa: BLE001 - of anybody's own classes, as text, which can always be sent
            results.append(ChildProcessError(f"{type(error).__name__}: {error}"))
        if time.monotonic() - begun >= BUNDLE_S:
            break
    gc.collect(1)  # what plugins leave in cycles
    return results


@cache
def _prepare(folder: str) -> None:
    """One thread a process, and the plan's working directory: paths may be relative to it.

    Garbage is collected as seldom as in a command, and after each bundle: it took a tenth of a run.
    """
    from threadpoolctl import threadpool_limits

    gc.set_threshold(50_000, 20, 100)
    keep_output_plain()
    threadpool_limits(1)
    if Path(folder).is_dir():
        os.chdir(folder)
