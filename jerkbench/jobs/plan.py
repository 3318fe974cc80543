"""The plan of what runs: which jobs, in which tasks, in an order in which what follows shares its input."""

import math
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from jerkbench.arrays import WIDE
from jerkbench.errors import PluginError, RecordingError
from jerkbench.jobs.inputs import KEPT_INPUTS
from jerkbench.jobs.job import Job, Scenario
from jerkbench.jobs.names import refusal
from jerkbench.jobs.preflight import require_inputs
from jerkbench.jobs.rows import Task, shared_call, streams

MIN_CHUNKS = 4
"""Chunks for each worker, so that all workers finish at about the same time."""
MAX_TASKS = 64
"""Tasks of a chunk, and jobs of a call."""


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
    """Leave out combinations that are refused or whose recording cannot be used, and join the seeds of equal jobs.

    Raises:
        RecordingError: none of the recordings can be used.
        PluginError: two jobs would have the same name in the table.
    """
    left_out: Counter[str] = Counter()
    checked: set[tuple[object, object]] = set()
    usable = list[Job]()
    unusable: RecordingError | None = None
    for job in sharing_scenarios(jobs):
        if reason := refusal(job):
            left_out[f"{reason}."] += 1
            continue
        try:
            require_inputs(job, checked)
            job.key  # noqa: B018 - which reads the files of the recording
        except RecordingError as error:
            left_out[f"the recording {job.labels.dataset} cannot be used: {error}"] += 1
            unusable = unusable or error
        else:
            usable.append(job)
    if unusable and not usable:
        raise unusable
    lines = tuple(f"Left out {count} combination{'s' * (count > 1)}: {reason}" for reason, count in left_out.items())
    plan = Plan(joined_jobs(usable), lines)
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


def chunks_of(
    jobs: Sequence[Job], remaining: Mapping[str, Collection[int]] | None = None, workers: int = 1
) -> list[list[Task]]:
    """Cut a plan into chunks. The tasks of a chunk share their scenario and seeds, so a worker prepares them once.

    Scenarios of one data set follow each other, and each is finished before the next: an interrupted sweep has complete
    combinations.

    Args:
        jobs: those of the plan.
        remaining: seeds to run, by key; default: all of all jobs.
        workers: number of processes.
    """
    wanted = {job.key: set(job.draws if remaining is None else remaining.get(job.key, ())) for job in jobs}
    data: dict[object, dict[object, list[Job]]] = {}
    for job in jobs:
        if wanted[job.key]:
            scenario = job.scenario
            scenarios = data.setdefault((scenario.dataset, scenario.data), {})
            scenarios.setdefault((scenario.disturbances, scenario.attitude), []).append(job)
    ordered = [own for scenarios in data.values() for own in scenarios.values()]
    seeds = [sorted(set[int]().union(*(wanted[job.key] for job in own))) for own in ordered]
    size = _seeds_of_chunk(sum(map(len, seeds)), sum(map(len, ordered)), workers)
    blocks = [
        (own, every[start : start + size])
        for own, every in zip(ordered, seeds, strict=True)
        for start in range(0, len(every), size)
    ]
    pieces = math.ceil(MIN_CHUNKS * workers / max(len(blocks), 1)) if workers > 1 else 1
    chunks = []
    for own, block in blocks:
        tasks = _tasks_of(own, block, wanted, min(math.ceil(len(own) / pieces), MAX_TASKS))
        length = min(math.ceil(len(tasks) / pieces), MAX_TASKS)
        chunks += [tasks[start : start + length] for start in range(0, len(tasks), length)]
    return chunks


def _seeds_of_chunk(recordings: int, jobs: int, workers: int) -> int:
    """As many seeds as a process caches recordings, if there are enough chunks then; else full vectors of runs.

    Methods are divided before seeds, so that an interrupted sweep has complete combinations.
    """
    if workers == 1:
        return KEPT_INPUTS
    size = min(max(recordings // (MIN_CHUNKS * workers) // WIDE * WIDE, WIDE), KEPT_INPUTS)
    return size if jobs >= workers else max(1, min(size, recordings // workers))


def _tasks_of(
    jobs: Sequence[Job], block: Sequence[int], wanted: Mapping[str, Collection[int]], most: int
) -> list[Task]:
    """The tasks of one scenario and some of its seeds. Jobs that can share a call are one task, at most ``most``."""
    calls: dict[tuple[object, tuple[int, ...]], list[Job]] = {}
    tasks = []
    for job in jobs:
        draws = tuple(draw for draw in block if draw in wanted[job.key])
        if draws and streams(job):
            calls.setdefault((shared_call(job), draws), []).append(job)
        else:
            tasks += [Task((job,), (draw,)) for draw in draws]
    for (_, draws), own in calls.items():
        tasks += [Task(tuple(own[start : start + most]), draws) for start in range(0, len(own), most)]
    return tasks
