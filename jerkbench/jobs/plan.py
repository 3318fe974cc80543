"""The plan of a sweep: its jobs and tasks, ordered such that consecutive tasks use the same recordings.

Before the first run, the jobs are checked, and warnings about plugins and recordings are collected.
"""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

from jerkbench.arrays import WIDE
from jerkbench.contracts import Remarking, Requiring, has_methods
from jerkbench.errors import JerkbenchError, PluginError, RecordingError
from jerkbench.inspection.diagnostics import first_diagnoses
from jerkbench.jobs.job import Job, Scenario, contract_violations
from jerkbench.jobs.names import refusal
from jerkbench.jobs.rows import MAX_CACHED_INPUTS, Task, remarks_of, shared_call, shared_inputs, streams
from jerkbench.report.labels import bare

MIN_CHUNKS = 4
"""Minimum number of chunks for each worker, so that all workers finish at about the same time."""
_ADAPTATIONS = "{adaptations}"
"""Placeholder in a message for the names of the unsupported adaptations."""
MAX_TASKS = 64
"""Maximum number of tasks in a chunk, and of jobs in a task."""


@dataclass(frozen=True, eq=False)
class Plan:
    """The jobs of a sweep, and messages about the combinations that cannot run.

    Attributes:
        jobs: All jobs of the sweep in order.
        refused: Messages about the combinations that are left out because they cannot run.
    """

    jobs: tuple[Job, ...]
    refused: tuple[str, ...] = ()

    @property
    def draws(self) -> dict[str, Sequence[int]]:
        """The seeds of each job by its key."""
        return {job.key: job.draws for job in self.jobs}


def planned(jobs: Iterable[Job]) -> Plan:
    """Return the plan of a sweep.

    Combinations that cannot run are left out, and equal jobs become one job with all their seeds. A combination cannot
    run if its filter does not support the data set or the adaptation, or if the recording cannot be used.

    Raises:
        RecordingError: No combination can run, and at least one recording cannot be used.
        PluginError: Two different jobs have the same labels.
    """
    left_out: dict[str, list[str]] = {}
    checked: set[tuple[object, object]] = set()
    usable = list[Job]()
    unusable: RecordingError | None = None
    for job in sharing_scenarios(jobs):
        reason = refusal(job, _ADAPTATIONS)
        try:
            if not reason:
                require_inputs(job, checked)
                job.key  # noqa: B018 - computing the key reads the files of the recording
        except RecordingError as error:
            reason = f"the recording {job.labels.dataset} cannot be used: {error}".rstrip(".")
            unusable = unusable or error
        if reason:
            left_out.setdefault(reason, []).append(job.spec["adaptation"]["name"])
        else:
            usable.append(job)
    if unusable and not usable:
        raise unusable
    joined = joined_jobs(usable)
    _require_names(joined)
    return Plan(joined, tuple(_left_out(reason, adaptations) for reason, adaptations in left_out.items()))


def _left_out(reason: str, adaptations: Sequence[str]) -> str:
    """Return the message about the combinations that are left out for one reason.

    The message lists the adaptations of these combinations.
    """
    count, names = len(adaptations), ", ".join(dict.fromkeys(adaptations))
    return f"Left out {count} combination{'s' * (count > 1)}: {reason.replace(_ADAPTATIONS, names)}."


def sharing_scenarios(jobs: Iterable[Job]) -> list[Job]:
    """Return the jobs, with one object for all equal scenarios, so that the data of a scenario are hashed only once."""
    first: dict[object, Scenario] = {}
    scenarios = ((job, job.scenario) for job in jobs)
    return [replace(job, scenario=first.setdefault((s.dataset, s.disturbances, s.attitude), s)) for job, s in scenarios]


def joined_jobs(jobs: Iterable[Job]) -> tuple[Job, ...]:
    """Return one job for each key. The job has the seeds of all ``jobs`` with this key."""
    first: dict[str, Job] = {}
    draws: dict[str, set[int]] = {}
    for job in jobs:
        first.setdefault(job.key, job)
        draws.setdefault(job.key, set()).update(job.draws)
    ordered = {key: in_order(seeds) for key, seeds in draws.items()}
    return tuple(  # a copy would lose the cached key, so a job with the same seeds is not copied
        job if job.draws == ordered[key] else replace(job, draws=ordered[key]) for key, job in first.items()
    )


def in_order(draws: Collection[int]) -> Sequence[int]:
    """Return the sorted seeds: a range if the seeds are consecutive, otherwise a list."""
    first, last = min(draws), max(draws)
    return range(first, last + 1) if last - first + 1 == len(draws) else sorted(draws)


def missing(job: Job, known: Iterable[int]) -> Sequence[int]:
    """Return the seeds of a job that are not in ``known``, the seeds of the stored runs."""
    done = set(known)
    return [draw for draw in job.draws if draw not in done] if done else job.draws


def _require_names(jobs: Sequence[Job]) -> None:
    """Raise an exception if two different jobs have the same labels."""
    first: dict[object, Job] = {}
    for job in jobs:
        namesake = first.setdefault(job.labels, job)
        if namesake is not job:
            parts = [part for part in job.spec if job.spec[part] != namesake.spec[part]]
            name, differing = ", ".join(job.labels), " and ".join(parts or ["the protocol"])
            advice = "run the two combinations in separate studies (study=NAME)"
            raise PluginError(f"Two combinations with the labels {name} differ in {differing}; {advice}.")


def chunks_of(jobs: Sequence[Job], wanted: Mapping[str, set[int]], workers: int) -> list[list[Task]]:
    """Divide jobs into chunks of tasks. The tasks of a chunk use the same recordings, which the worker loads once.

    The chunks are sorted by data set and scenario. Therefore, most combinations of an interrupted sweep are either
    complete or not started.

    Args:
        jobs: The jobs of the plan.
        wanted: The seeds that are not stored yet, by the key of the job.
        workers: The number of worker processes.
    """
    data: dict[object, dict[object, list[Job]]] = {}
    for job, s in ((job, job.scenario) for job in jobs if wanted[job.key]):
        data.setdefault((s.dataset, s.data), {}).setdefault((s.disturbances, s.attitude), []).append(job)
    ordered = [group for scenarios in data.values() for group in scenarios.values()]
    seeds = [sorted(set[int]().union(*(wanted[job.key] for job in group))) for group in ordered]
    size = _seeds_of_chunk(sum(map(len, seeds)), sum(map(len, ordered)), workers)
    pairs = zip(ordered, seeds, strict=True)
    blocks = [(group, every[k : k + size]) for group, every in pairs for k in range(0, len(every), size)]
    pieces = math.ceil(MIN_CHUNKS * workers / max(len(blocks), 1)) if workers > 1 else 1
    chunks = []
    for group, block in blocks:
        tasks = _tasks_of(group, block, wanted, min(math.ceil(len(group) / pieces), MAX_TASKS))
        length = min(math.ceil(len(tasks) / pieces), MAX_TASKS)
        chunks += [tasks[start : start + length] for start in range(0, len(tasks), length)]
    return chunks


def _seeds_of_chunk(recordings: int, jobs: int, workers: int) -> int:
    """Return the number of seeds in a chunk, which is at most the number of recordings that a process caches.

    If there would be too few chunks for all workers, the number of seeds per chunk is reduced to a multiple of the
    vector width (the number of runs that a processor computes at once). If there are fewer jobs than workers, the
    number of seeds per chunk may be less than the vector width.
    """
    if workers == 1:
        return MAX_CACHED_INPUTS
    size = min(max(recordings // (MIN_CHUNKS * workers) // WIDE * WIDE, WIDE), MAX_CACHED_INPUTS)
    return size if jobs >= workers else max(1, min(size, recordings // workers))


def _tasks_of(jobs: Sequence[Job], block: Sequence[int], wanted: Mapping[str, set[int]], maximum: int) -> list[Task]:
    """Return the tasks that run the jobs of one scenario for a block of seeds.

    Each task contains up to ``maximum`` jobs, which can run in one batch.
    """
    calls: dict[tuple[object, tuple[int, ...]], list[Job]] = {}
    tasks = []
    for job in jobs:
        draws = tuple(draw for draw in block if draw in wanted[job.key])
        if draws and streams(job):
            calls.setdefault((shared_call(job), draws), []).append(job)
        else:
            tasks += [Task((job,), (draw,)) for draw in draws]
    for (_, draws), members in calls.items():
        tasks += [Task(tuple(members[start : start + maximum]), draws) for start in range(0, len(members), maximum)]
    return tasks


# The checks and warnings before the first run.


def require_inputs(job: Job, checked: set[tuple[object, object]]) -> None:
    """Check that the recording of the first seed has the inputs that the attitude and the navigation filter require.

    Args:
        job: The job, whose recording is loaded only if one of the two filters has requirements.
        checked: Pairs of a data set and a filter that are already checked. The function adds the pairs of ``job`` to
            this set.

    Raises:
        JerkbenchError: The recording does not exist, or lacks an input that a filter requires.
    """
    for part in (job.scenario.attitude, job.method.filter):
        if has_methods(part, Requiring) and (job.scenario.dataset, part) not in checked:
            try:
                part.require(lambda: job.scenario.dataset.load(job.draws[0]))
            except JerkbenchError:
                raise
            except Exception:  # noqa: BLE001, S110 - the run raises it again, and its row gets the status "failed"
                pass
            checked.add((job.scenario.dataset, part))


def first_complaints(jobs: Iterable[Job]) -> list[str]:
    """Return a warning for each plugin of ``jobs`` that violates its contract.

    All runs that use a plugin with a warning will fail.
    """
    complaints = dict(complaint for job in jobs for complaint in contract_violations(job))
    return [f"Every run with the {title} will fail: {message}" for title, message in complaints.items()]


def first_notes(jobs: Sequence[Job]) -> list[str]:
    """Return warnings about obvious mistakes in the recordings of a sweep, and the notes of the attitude filters.

    The command `data inspect` finds more mistakes. Simulated recordings are not checked, and notes about simulated
    recordings are printed below the table instead.
    """
    inputs, recorded = shared_inputs(), [job for job in jobs if not job.scenario.dataset.seeded]
    drives = {job.scenario.dataset: job for job in recorded}
    firsts: dict[object, Job] = {}
    for job in recorded:
        firsts.setdefault(job.scenario, job)
    mistakes, remarks = list[str](), list[str]()
    for job in drives.values():
        with suppress(Exception):  # the run raises the exception again, and its row gets the status "failed"
            drive = inputs.undisturbed(job.scenario.dataset, job.draws[0])
            mistakes += [f"{bare(job.labels.dataset)}: {diagnosis}" for diagnosis in first_diagnoses(drive)]
    for job in firsts.values():
        if isinstance(job.scenario.attitude, Remarking):
            with suppress(Exception):  # the run raises the exception again
                remarks += remarks_of(job, inputs.recording(job.scenario, job.draws[0]))
    return [*mistakes, *dict.fromkeys(remarks)]
