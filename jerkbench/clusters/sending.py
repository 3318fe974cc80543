"""Bundles on their way: packed where the plan is, opened and run where the worker is."""

import os
import pickle
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from jerkbench.clusters.cluster import ClusterError
from jerkbench.clusters.identity import Identity, refusal
from jerkbench.errors import JerkbenchError
from jerkbench.plain import keep_output_plain

Task = TypeVar("Task")
Result = TypeVar("Result")


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
