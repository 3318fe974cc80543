"""The plan of what runs: which jobs, in which tasks, in an order in which what follows shares its input."""

import itertools
import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from jerkbench.arrays import WIDE
from jerkbench.contracts import PerSeed
from jerkbench.errors import PluginError
from jerkbench.jobs.inputs import KEPT_INPUTS
from jerkbench.jobs.job import Job, Scenario
from jerkbench.jobs.names import refusal
from jerkbench.jobs.preflight import require_inputs
from jerkbench.jobs.rows import Task, shared_call

BUNDLES = 128
"""Bundles of a plan, as long as none has more than `MOST_TASKS`."""
MOST_TASKS = 64
"""Tasks of a bundle: a cluster needs some milliseconds for each bundle, and loses as much with a worker."""


@dataclass(frozen=True, eq=False)
class Plan:
    """The plan of a sweep.

    Attributes:
        jobs: all of them, in order.
        refused: sentences about the combinations that make no sense and are left out.
    """

    jobs: tuple[Job, ...]
    refused: tuple[str, ...] = ()

    @property
    def draws(self) -> dict[str, Sequence[int]]:
        """The seeds of each job, by its key."""
        return {job.key: job.draws for job in self.jobs}


def planned(jobs: Iterable[Job]) -> Plan:
    """Leave out what is refused, and join the seeds of what is there twice.

    Raises:
        RecordingError: the data of a job are not there, or lack what its filters were asked to use.
        PluginError: two jobs would have the same name in the table.
    """
    refused: dict[str, int] = {}
    checked: set[tuple[object, object]] = set()
    sensible = []
    for job in jobs:
        if reason := refusal(job):
            refused[reason] = refused.get(reason, 0) + 1
            continue
        require_inputs(job, checked)
        sensible.append(job)
    lines = tuple(f"Left out {count} combination{'s' * (count > 1)}: {reason}." for reason, count in refused.items())
    plan = Plan(joined_jobs(sharing_scenarios(sensible)), lines)
    _require_names(plan.jobs)
    return plan


def sharing_scenarios(jobs: Iterable[Job]) -> list[Job]:
    """Return the jobs with one object for each scenario, whose data are looked at once."""
    first: dict[object, Scenario] = {}
    scenarios = ((job, job.scenario) for job in jobs)
    return [replace(job, scenario=first.setdefault((s.dataset, s.disturbances, s.attitude), s)) for job, s in scenarios]


def joined_jobs(jobs: Iterable[Job]) -> tuple[Job, ...]:
    """Return each job once, with all its seeds."""
    first: dict[str, Job] = {}
    draws: dict[str, set[int]] = {}
    for job in jobs:
        first.setdefault(job.key, job)
        draws.setdefault(job.key, set()).update(job.draws)
    ordered = {key: in_order(own) for key, own in draws.items()}
    return tuple(  # one with these very seeds keeps what is known of it
        job if job.draws == ordered[key] else replace(job, draws=ordered[key]) for key, job in first.items()
    )


def in_order(draws: Collection[int]) -> Sequence[int]:
    """Return seeds in their order, in short where none between the first and the last is missing."""
    first, last = min(draws), max(draws)
    return range(first, last + 1) if last - first + 1 == len(draws) else sorted(draws)


def missing(job: Job, known: Iterable[int]) -> Sequence[int]:
    """Return the seeds of a job that are not ``known``."""
    done = set(known)
    return [draw for draw in job.draws if draw not in done] if done else job.draws


def _require_names(jobs: Sequence[Job]) -> None:
    """Refuse two jobs that no column of the table would tell apart."""
    first: dict[object, Job] = {}
    for job in jobs:
        namesake = first.setdefault(job.labels, job)
        if namesake is not job:
            parts = [part for part in job.spec if job.spec[part] != namesake.spec[part]]
            raise PluginError(
                f"Two combinations would both be called {', '.join(job.labels)}: they differ in "
                f"{' and '.join(parts or ['the protocol'])} in a way that no column shows; run them into studies of"
                " their own (study=NAME)."
            )


# Tasks: cut from the whole plan, so that their bundles have the same numbers in every process that has it.


def grouped(
    jobs: Sequence[Job], remaining: Mapping[str, Collection[int]] | None = None, least: int = 1
) -> list[list[Task]]:
    """Tasks that share their recordings and attitudes, together; groups that share the data set follow each other.

    Those of a bundle that can share their calls are one. A task has no more seeds than a process keeps recordings. The
    numbers of the bundles depend on ``jobs`` alone.

    Args:
        jobs: those of the plan.
        remaining: by key, the seeds that are to run; default: all of all jobs.
        least: so many jobs make a bundle at least.
    """
    groups: dict[object, dict[object, list[Task]]] = {}
    for job in jobs:
        scenario = job.scenario
        each_alone = isinstance(job.method.filter, PerSeed)  # a program of the user's
        wanted = job.draws if remaining is None else remaining.get(job.key, ())
        wanted, size = set(wanted), 1 if each_alone else KEPT_INPUTS
        for begin in range(0, len(job.draws), size):
            block = job.draws[begin : begin + size]
            draws = block if wanted.issuperset(block) else [draw for draw in block if draw in wanted]
            near = groups.setdefault((scenario.dataset, scenario.data, block[0]), {})
            near.setdefault((scenario.disturbances, scenario.attitude), []).append(Task((job,), draws))
    several = [_calls(group) for near in groups.values() for group in near.values()]
    # Bundles are few enough to go round and long enough to share; one of each group is shorter.
    count = sum(len(call) for calls in several for call in calls)
    size = min(max(math.ceil(count / BUNDLES), least), MOST_TASKS)
    size = size - size % WIDE or size
    number, cut = itertools.count(), list[list[Task]]()
    for calls in several:
        tasks = []
        for bundle in _bundles(calls, size):
            n = next(number)
            for call in bundle:
                for draws, own in itertools.groupby((task for task in call if task.draws), lambda task: task.draws):
                    tasks.append(Task(tuple(task.jobs[0] for task in own), draws, n))
        if tasks:
            cut.append(tasks)
    return cut


def _calls(group: Sequence[Task]) -> list[list[Task]]:
    """The tasks of a group by what may share a call, wherever in the plan they stand."""
    calls: dict[object, list[Task]] = {}
    for task in group:
        calls.setdefault(shared_call(task.jobs[0]), []).append(task)
    return list(calls.values())


def _bundles(calls: Sequence[Sequence[Task]], size: int) -> Iterator[list[Sequence[Task]]]:
    """Fill bundles of ``size`` tasks; a call is cut where it alone is longer."""
    bundle: list[Sequence[Task]] = []
    for call in calls:
        for begin in range(0, len(call), size):
            part = call[begin : begin + size]
            if bundle and sum(map(len, bundle)) + len(part) > size:
                yield bundle
                bundle = []
            bundle.append(part)
    if bundle:
        yield bundle
