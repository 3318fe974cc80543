"""Computation of the result rows of a study, and caches of the inputs that several runs use.

If the plugins support batches, one batch computes the runs of several seeds and jobs. The caches contain recordings,
attitudes, timelines and prepared references.
"""

import hashlib
import os
import pickle
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from jerkbench.arrays import BoolArray, Same
from jerkbench.contracts import (
    Adaptation,
    AttitudeFilter,
    Batched,
    Dataset,
    Disturbance,
    Engine,
    Estimator,
    Filter,
    Metric,
    PerSeed,
    Remarking,
    SideBySide,
    Summarising,
    has_methods,
    part_read,
)
from jerkbench.errors import JerkbenchError, PluginError, notify, plain
from jerkbench.estimate import Attitude, Estimate, Streamed, no_attitude
from jerkbench.evaluation.counted_rows import require_begin
from jerkbench.evaluation.evaluated_run import (
    PreparedReference,
    can_stream,
    evaluate_run,
    metric_values,
    outlined,
    prepare_reference,
    run_status,
    sums_from,
    why_diverged,
)
from jerkbench.files import Distrusted, cache_folder, forget_oldest, read_trusted, write_trusted
from jerkbench.io.sanitiser import imu_gap_notes
from jerkbench.jobs.job import Job, Scenario, plugin_errors, reason_of, unfit
from jerkbench.jobs.key import code_digest, plugin_digest, require_data, versions
from jerkbench.recording import Recording
from jerkbench.report.labels import bare
from jerkbench.timeline import RecordedRun, Run, Timeline, build_timeline, scaled_timeline, with_r_scale

Row = dict[str, Any]
NotedRows = tuple[list[Row], list[str]]
"""The rows of some seeds of a job, and the notes below the table of the job."""


class Task(NamedTuple):
    """A unit of work: some seeds of one job, or of several jobs that can run in one batch.

    Attributes:
        jobs: Jobs with the same scenario.
        draws: The seeds that all jobs of the task run.
    """

    jobs: tuple[Job, ...]
    draws: Sequence[int]

    def parts(self) -> "list[Task]":
        """Return one task for each job of this task, with the same seeds."""
        return [Task((job,), self.draws) for job in self.jobs]


def job_rows(job: Job, draws: Sequence[int] = (), *, strict: bool = False) -> NotedRows:
    """Return a row for each seed of ``draws`` (by default, all seeds of the job), and the notes below the table.

    Raises:
        JerkbenchError: An input or a plugin failed, and ``strict`` is set.
    """
    draws, size = draws or job.draws, MAX_CACHED_INPUTS if streams(job) else 1
    tasks = [Task((job,), draws[start : start + size]) for start in range(0, len(draws), size)]
    return joined_pieces(task_rows(task, strict=strict)[0] for task in tasks)


def task_rows(task: Task, *, strict: bool = False, threads: int = 1) -> list[NotedRows]:
    """Return the rows of each job of a task, and the notes below the table of this job.

    Args:
        task: The task, which contains some seeds of one or several jobs.
        strict: Whether to raise errors of inputs and plugins instead of returning rows with the status "failed".
        threads: Number of threads that the engine may use.

    Raises:
        JerkbenchError: An input or a plugin failed, and ``strict`` is set.
    """
    if message := unfit(task.jobs[0]):
        return [failed_piece(job, task.draws, PluginError(message), strict=strict) for job in task.jobs]
    if streams(task.jobs[0]):
        return _together(task.jobs, task.draws, strict=strict, threads=threads)
    return [joined_pieces(single_run(job, draw, strict=strict) for draw in task.draws) for job in task.jobs]


def run_seed(job: Job, draw: int) -> tuple[Recording, Estimate]:
    """Run one seed of a job, and return the recording and the estimate.

    Exceptions of plugins are not converted to `PluginError`.
    """
    inputs, scenario, method = shared_inputs(), job.scenario, job.method
    recording = inputs.recording(scenario, draw)
    attitude = inputs.attitude(recording, scenario.attitude)
    model = method.filter.of_seed(draw) if isinstance(method.filter, PerSeed) else method.filter
    if isinstance(model, Estimator):
        scaled = inputs.scaled(recording, method.r_scale)
        return recording, solution(scaled, attitude, model, method.adaptation, method.engine)
    timeline = scaled_timeline(inputs.timeline(recording, attitude), recording, attitude, method.r_scale)
    return recording, method.engine.run(timeline, model, method.adaptation)


def single_run(job: Job, draw: int, *, strict: bool) -> NotedRows:
    """Run one seed of a job separately (not in a batch), and return its row and the notes for the table."""
    protocol = job.protocol
    try:
        recording, estimate = run_seed(job, draw)
        if isinstance(job.method.filter, PerSeed):
            require_begin(estimate, recording, protocol.burn_in_s)
        status, reason = run_status(estimate, recording, protocol.divergence_limit_m)
        values = evaluate_run(estimate, recording, protocol.burn_in_s, [*job.metrics.values()])
        notes = [*notes_of(job, recording), *_covariance_notes(job, values, estimate)]
        return [{**_head(job, draw, status, reason), **values, **recording.parameters}], notes
    except Exception as error:  # noqa: BLE001 - any exception of a plugin becomes a failed row or an error message
        return failed_piece(job, [draw], error, strict=strict)


def _covariance_notes(job: Job, values: Mapping[str, float], estimate: Estimate | None = None) -> list[str]:
    """Return a note if the filter estimates a covariance and the position error is finite, but the ANEES is not."""
    anees = values.get("anees_position", 0.0)
    estimated = estimate is None or bool(np.isfinite(estimate.covariance[:, :3, :3]).any())
    if np.isfinite(anees) or not estimated or not np.isfinite(values.get("position_rmse_m", np.nan)):
        return []
    cause = "Its covariance is not always positive definite, for example after a long gap."
    return [f"The ANEES of {job.labels.filter} is not finite. {cause}"]


def failed_piece(job: Job, draws: Sequence[int], error: Exception, *, strict: bool) -> NotedRows:
    """Return rows with the status "failed" and the text of an exception.

    If ``strict`` is set, raise the exception instead.
    """
    if strict:
        with plugin_errors(job):
            raise error
    return failed_rows(job, draws, str(error) if isinstance(error, JerkbenchError) else reason_of(error)), []


def failed_rows(job: Job, draws: Sequence[int], reason: str) -> list[Row]:
    """Return rows with the status "failed" for some seeds of a job."""
    return [_head(job, draw, "failed", reason) for draw in draws]


def _head(job: Job, draw: int, status: str, reason: str) -> Row:
    replicate = "seed" if job.seeded else "phase"
    return {**job.labels._asdict(), "seed": draw, "replicate": replicate, "status": status, "reason": plain(reason)}


def joined_pieces(several: Iterable[NotedRows]) -> NotedRows:
    """Join the rows and the notes of several runs of a job. Each distinct note is returned once."""
    rows, notes = zip(*several, strict=True)
    return [row for piece in rows for row in piece], list(dict.fromkeys(note for piece in notes for note in piece))


def solution(
    recording: Recording, attitude: Attitude, model: Filter | Estimator, adaptation: Adaptation, engine: Engine
) -> Estimate:
    """Run a filter on a recording.

    If the engine is compiled, an estimator uses its compiled implementation if it has one.
    """
    if not isinstance(model, Estimator):
        return engine.run(build_timeline(recording, attitude), model, adaptation)
    quick = None
    if isinstance(model, Batched) and isinstance(engine, SideBySide):
        quick = model.estimate_compiled(recording, attitude, adaptation)
    return model.estimate(recording, attitude, adaptation) if quick is None else quick


# Runs in a batch store no trajectories. Their metrics are computed from sums that are accumulated during the run.


def shared_call(job: Job) -> object:
    """Return a key for grouping the jobs of a scenario: jobs with equal keys can run in one batch.

    For a job that cannot run in a batch, the key is the job itself.
    """
    if not streams(job) or unfit(job):
        return job
    method, limits = job.method, job.protocol.limits.values()
    return type(method.filter), type(method.adaptation), method.engine, *job.metrics.values(), *limits


def streams(job: Job) -> bool:
    """Return whether a job can run in a batch: all its plugins must work without stored trajectories."""
    able = has_methods(job.method.filter, Batched) or not isinstance(job.method.filter, Estimator)
    return able and has_methods(job.method.engine, SideBySide) and all(map(can_stream, job.metrics.values()))


def _together(jobs: Sequence[Job], draws: Sequence[int], *, strict: bool, threads: int) -> list[NotedRows]:
    try:
        streamed = _streamed(jobs, draws, threads)
    except Exception as error:  # noqa: BLE001 - any exception of an engine becomes failed rows or an error message
        if len(jobs) == 1:
            return [failed_piece(jobs[0], draws, error, strict=strict)]
        single = (_together([job], draws, strict=strict, threads=threads) for job in jobs)  # to find the failing job
        return [piece for pieces in single for piece in pieces]
    return [
        joined_pieces(streamed.get((k, draw)) or single_run(job, draw, strict=strict) for draw in draws)
        for k, job in enumerate(jobs)
    ]


_Notes = dict[object, list[str]]


class _ReadySeed(NamedTuple):
    """The inputs of one run of a batch, with R as reported (before R is scaled)."""

    recording: Recording
    attitude: Attitude
    timeline: Timeline
    reference: PreparedReference


def _finished(job: Job, draw: int, seed: _ReadySeed, result: Streamed, notes: _Notes) -> NotedRows:
    """Return the row and notes of a finished run of a batch. ``notes`` caches the notes of equal inputs."""
    reason, values = why_diverged(result, seed.reference, seed.recording), _values(job, seed, result)
    key = draw, job if has_methods(job.method.filter, Remarking) else job.labels.dataset
    seed_notes = notes.get(key) or notes.setdefault(key, notes_of(job, seed.recording))
    head = _head(job, draw, "diverged" if reason else "ok", reason)
    return [{**head, **values, **seed.recording.parameters}], [*seed_notes, *_covariance_notes(job, values)]


def _streamed(jobs: Sequence[Job], draws: Sequence[int], threads: int) -> dict[tuple[int, int], NotedRows]:
    """Run the seeds ``draws`` of all ``jobs`` in one batch, and return the finished runs by (index of the job, seed).

    Runs that stopped early or failed, and runs whose metrics need a trajectory, are not returned. The caller runs the
    missing seeds again one by one. Exceptions of the engine are not caught.
    """
    every = {draw: _ready(jobs[0], draw) for draw in draws}
    ready = {(k, draw): seed for k in range(len(jobs)) for draw, seed in every.items() if seed is not None}
    if not ready:
        return {}
    results = _run_all([(jobs[k], seed) for (k, _), seed in ready.items()], threads)
    notes: _Notes = {}
    return {
        (k, draw): _finished(jobs[k], draw, seed, result, notes)
        for ((k, draw), seed), result in zip(ready.items(), results, strict=True)
        if result is not None
    }


def _ready(job: Job, draw: int) -> _ReadySeed | None:
    """Return the inputs of a run. Return None if an input cannot be loaded, or if the run cannot be part of a batch."""
    inputs = shared_inputs()
    try:
        recording = inputs.recording(job.scenario, draw)
        attitude = inputs.attitude(recording, job.scenario.attitude)
        timeline = inputs.timeline(recording, attitude)
    except Exception:  # noqa: BLE001 - `single_run` raises it again
        return None
    protocol = job.protocol
    reference = inputs.prepared(recording, timeline, protocol.burn_in_s, protocol.divergence_limit_m)
    return None if reference is None else _ReadySeed(recording, attitude, timeline, reference)


def _run_all(runs: Sequence[tuple[Job, _ReadySeed]], threads: int) -> Sequence[Streamed | None]:
    """Compute all runs with one call of the estimator or of the engine."""
    first, metrics = runs[0][0].method, runs[0][0].metrics.values()
    reads = set(map(part_read, metrics))
    updates, attitude = "updates" in reads, "attitude" in reads
    models: list[Any] = [job.method.filter for job, _ in runs]
    rules = [job.method.adaptation for job, _ in runs]
    covariance, speeds = (
        any(getattr(metric, part, has_methods(metric, Summarising)) for metric in metrics)
        for part in ("reads_covariance", "reads_velocity")
    )
    scoring = "scoring" if covariance else "errors_only" if speeds else "positions_only"
    recorded = [
        RecordedRun(
            seed.recording,
            seed.attitude,
            scaled_timeline(seed.timeline, seed.recording, seed.attitude, job.method.r_scale),
            getattr(seed.reference, scoring),
            job.method.r_scale,
        )
        for job, seed in runs
    ]
    if isinstance(first.filter, Batched):
        call_options: dict[str, Any] = {"updates": updates, "attitude": attitude, "threads": threads}
        return first.filter.run_settings(recorded, models, rules, **call_options)
    bare = [Run(run.timeline, run.scoring) for run in recorded]
    engine = cast("SideBySide", first.engine)
    return engine.run_settings(bare, models, rules, updates=updates, threads=threads)


def _values(job: Job, seed: _ReadySeed, result: Streamed) -> dict[str, float]:
    """Return the values of the metric columns of a run, computed from sums that were accumulated during the run."""
    outline = seed.reference.outline
    if result.euler_rad is not None:  # the filter estimates the attitude
        outline = outlined(outline.index, result.euler_rad)
    if len(result.updates.t_s):
        outline = replace(outline, updates=result.updates)
    sums, run = sums_from(result, seed.reference, seed.recording), (outline, seed.recording, seed.reference.counted)
    return metric_values(job.metrics.values(), sums, run, shared_inputs().columns)


# The notes below a table describe the reference and the recording, and include the notes of both filters.


def notes_of(job: Job, recording: Recording) -> list[str]:
    """Return the notes that are printed below the table of a job."""
    return [plain(note) for note in (*_reference_notes(job, recording), *remarks_of(job, recording))]


def _reference_notes(job: Job, recording: Recording) -> list[str]:
    reference, name = recording.reference, bare(job.labels.dataset)
    notes = [f"{name}: {note}" for note in (*recording.notes, *imu_gap_notes(recording.imu))]
    if reference.empty:
        return [f"{name} has no reference: {reference.source}.", *notes]
    independence = "independent of" if reference.independent else "not independent of"
    return [f"Reference of {name}: {reference.source}; {independence} the measurements.", *notes]


def remarks_of(job: Job, recording: Recording) -> list[str]:
    """Return the notes of the attitude filter and of the navigation filter about a recording."""
    parts = job.scenario.attitude, job.method.filter
    of_attitude, of_filter = (part.remarks(recording) if has_methods(part, Remarking) else () for part in parts)
    return [*(f"{bare(job.labels.dataset)}: {note}" for note in of_attitude), *of_filter]


# The cached inputs of several runs. Simulated recordings are also stored in the cache folder of the user, so that later
# sweeps do not simulate them again.

SIMULATED = "simulated"
"""The kind of cache folder that contains simulated recordings."""

SIMULATED_PATTERN = "simulated_*"
MAX_DRIVE_BYTES = 2_000_000_000
"""Maximum size of the cache (about 700 drives of 150 s). The least recently used drives are deleted first."""


def simulated(dataset: Dataset, seed: int) -> Recording:
    """Return the recording of a seed from the disk cache. A missing recording is simulated and stored in the cache."""
    path = cache_folder(SIMULATED) / f"simulated_{_key(dataset, seed)}.recording"
    stored = _read(path)
    if stored is not None:
        return stored
    recording = dataset.load(seed)
    with suppress(OSError):  # if the disk is full or not writable, the next call simulates the recording again
        write_trusted(path, pickle.dumps(recording, 5))
        if seed % 16 == 0:
            forget_oldest(path.parent, SIMULATED_PATTERN, MAX_DRIVE_BYTES)
    return recording


def _key(dataset: Dataset, seed: int) -> str:
    """Return a hash of all inputs of a simulation: the data set, the code, the library versions and the seed."""
    parts = [repr(dataset), type(dataset).__qualname__, code_digest(), plugin_digest(type(dataset)), versions(), seed]
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:32]


def _read(path: Path) -> Recording | None:
    """Read a recording from a cache file. Return None if the cache file is missing, incomplete or from another user."""
    try:
        content = read_trusted(path)
    except Distrusted as reason:
        notify(f"The cached drive {path} is ignored, because {reason}. The drive is simulated again.")
        return None
    if content is None:
        return None
    with suppress(OSError):
        os.utime(path)  # `forget_oldest` deletes the least recently used files first
    recording: Recording = pickle.loads(content)  # noqa: S301 - only this user can have written it
    return recording


MetricValues = Mapping[str, float]
"""The value of each column of a metric."""

MAX_CACHED_INPUTS = 32
"""Maximum number of cached objects of each kind. A recording of 150 s at 100 Hz needs about 2 MB."""


class Inputs:
    """Caches of recordings, attitudes, timelines and prepared references, up to `MAX_CACHED_INPUTS` of each kind.

    The caches contain no reference to the `Inputs` object. Therefore, Python frees the memory of the caches (about 100
    MB) as soon as the program no longer uses the `Inputs` object.
    """

    def __init__(self) -> None:
        self._loaded = lru_cache(MAX_CACHED_INPUTS)(loaded)
        self._disturbed = lru_cache(MAX_CACHED_INPUTS)(partial(disturbed, self._loaded))
        self.attitude = lru_cache(MAX_CACHED_INPUTS)(attitude_of)
        self.scaled = lru_cache(MAX_CACHED_INPUTS)(with_r_scale)
        self.timeline = lru_cache(MAX_CACHED_INPUTS)(build_timeline)
        self.prepared = lru_cache(MAX_CACHED_INPUTS)(prepare_reference)
        self._attitude_columns = lru_cache(8 * MAX_CACHED_INPUTS)(_attitude_columns)

    def recording(self, scenario: Scenario, draw: int) -> Recording:
        """Return the disturbed recording of a seed.

        The cache key contains the hash of the data, so changed data are reloaded.
        """
        return self._disturbed(scenario.dataset, scenario.disturbances, scenario.data, draw)

    def undisturbed(self, dataset: Dataset, draw: int) -> Recording:
        """Return the recording of a seed without disturbances."""
        return self._loaded(dataset, dataset.fingerprint(), draw)

    def columns(self, metric: Metric, estimate: Estimate, recording: Recording, counted: BoolArray) -> MetricValues:
        """Return the value of each column of a metric for one run.

        If the metric reads only the attitude, its values are cached for the other methods of a batch, whose runs have
        the same attitude object.
        """
        if part_read(metric) != "attitude":
            return metric.evaluate(estimate, recording, counted)
        attitude = Same(estimate.index, estimate.euler_rad, counted)
        return self._attitude_columns(cast("Hashable", metric), recording, attitude)


@cache
def shared_inputs() -> Inputs:
    """Return the input caches that all jobs in this process use."""
    return Inputs()


Load = Callable[[Dataset, str, int], Recording]


def disturbed(
    load: Load, dataset: Dataset, disturbances: tuple[Disturbance, ...], fingerprint: str, draw: int
) -> Recording:
    """Load the recording of a seed and apply the disturbances."""
    recording = load(dataset, dataset.fingerprint(), draw)
    for disturbance in disturbances:
        recording = disturbance.apply(recording, draw)
    require_data(dataset, disturbances, fingerprint)  # detects changes of the data while they were read
    return recording


def loaded(dataset: Dataset, fingerprint: str, seed: int) -> Recording:
    """Load the recording of a seed, and check that the data have not changed since ``fingerprint`` was computed.

    Recordings that a built-in data set simulates are cached on disk (`simulated`).
    """
    in_tree = type(dataset).__module__.startswith("jerkbench.")  # other data sets may read unhashed inputs
    if in_tree and dataset.seeded and not fingerprint:
        return simulated(dataset, seed)
    recording = dataset.load(seed)
    require_data(dataset, (), fingerprint)  # detects changes of the data while they were read
    return recording


def attitude_of(recording: Recording, attitude: AttitudeFilter) -> Attitude:
    """Estimate the attitude of a recording. Without an IMU, return the undefined attitude of `no_attitude`."""
    return no_attitude(recording.clock_s) if recording.imu is None else attitude.estimate(recording)


def _attitude_columns(metric: Hashable, recording: Recording, attitude: Same) -> MetricValues:
    index, euler_rad, counted = attitude.objects
    return cast("Metric", metric).evaluate(outlined(index, euler_rad), recording, counted)
