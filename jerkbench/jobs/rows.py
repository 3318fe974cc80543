"""Runs become rows: the seeds and the settings of a job side by side where its plugins can, else one at a time."""

import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple, cast

import numpy as np

from jerkbench.contracts import (
    Adaptation,
    Batched,
    Engine,
    Estimator,
    Filter,
    PerSeed,
    Remarking,
    SideBySide,
    Summarising,
    has_methods,
    part_read,
)
from jerkbench.errors import JerkbenchError, PluginError
from jerkbench.estimate import Attitude, Estimate, Streamed
from jerkbench.evaluation.counted_rows import require_begin
from jerkbench.evaluation.evaluated_run import (
    PreparedReference,
    Summary,
    can_stream,
    evaluate_run,
    metric_values,
    outlined,
    run_status,
    sums_from,
    why_strayed,
)
from jerkbench.jobs.inputs import KEPT_INPUTS, Inputs, shared_inputs
from jerkbench.jobs.job import Job
from jerkbench.jobs.key import processor_kind
from jerkbench.jobs.preflight import notes_of, plugins_in_words, reason_of, unfit
from jerkbench.notices import plain
from jerkbench.recording import Recording
from jerkbench.timeline import RecordedRun, Run, Timeline, build_timeline, told_timeline

Row = dict[str, Any]
NotedRows = tuple[list[Row], list[str]]
"""Rows of some seeds that are done together, and what a reader of them has to know."""


class Task(NamedTuple):
    """Some seeds of a job, or of several that share a call.

    Attributes:
        jobs: of one scenario.
        draws: the seeds.
    """

    jobs: tuple[Job, ...]
    draws: Sequence[int]

    def parts(self) -> "list[Task]":
        """Return the task of each job by itself."""
        return [Task((job,), self.draws) for job in self.jobs]


class Result(NamedTuple):
    """The result of a task for one of its jobs.

    Attributes:
        rows: of its seeds.
        notes: for their reader.
        seconds: time of the rows [s], without `inputs_s`.
        inputs_s: time that recordings and attitudes took [s].
        processor: kind of the processor that ran it; empty: nothing was run.
    """

    rows: list[Row]
    notes: list[str]
    seconds: float = 0.0
    inputs_s: float = 0.0
    processor: str = ""


@dataclass(frozen=True, eq=False)
class RunOptions:
    """Options of the computation of rows.

    Attributes:
        strict: raise what is wrong with the input or a plugin, in words; else it becomes rows with the status "failed".
        threads: number of threads of the engine.
        inputs: recordings, attitudes and timelines; default: those that all jobs of this process share.
    """

    strict: bool = False
    threads: int = 1
    inputs: Inputs = field(default_factory=shared_inputs)


def job_rows(job: Job, draws: Sequence[int] = (), *, strict: bool = False, inputs: Inputs | None = None) -> NotedRows:
    """Return a row for each seed of ``draws`` (default: all), and what a reader of them has to know.

    Raises:
        JerkbenchError: what is wrong, where it is ``strict``.
    """
    draws, size = draws or job.draws, KEPT_INPUTS if streams(job) else 1
    tasks = [Task((job,), draws[start : start + size]) for start in range(0, len(draws), size)]
    results = [work(task, strict=strict, inputs=inputs)[0] for task in tasks]
    return joined_pieces((result.rows, result.notes) for result in results)


def work(task: Task, *, strict: bool = False, threads: int = 1, inputs: Inputs | None = None) -> list[Result]:
    """Run a task; returns the result of each of its jobs.

    Raises:
        JerkbenchError: an error of the input or of a plugin, if it is ``strict``.
    """
    options, first = RunOptions(strict, threads, inputs or shared_inputs()), task.jobs[0]
    if sentence := unfit(first):
        return [Result(*failed_piece(job, task.draws, PluginError(sentence), options)) for job in task.jobs]
    started = time.perf_counter()
    for draw in task.draws:  # beforehand: the time of a run is that of the filter
        with suppress(Exception):  # the run raises it again
            options.inputs.attitude(options.inputs.recording(first.scenario, draw), first.scenario.attitude)
    prepared = time.perf_counter()
    if streams(first):
        pieces = _together(task.jobs, task.draws, options)
    else:
        pieces = [joined_pieces(alone(job, draw, options) for draw in task.draws) for job in task.jobs]
    fraction = 1.0 / len(task.jobs)
    seconds, inputs_s = fraction * (time.perf_counter() - prepared), fraction * (prepared - started)
    return [Result(*piece, seconds, inputs_s, processor_kind()) for piece in pieces]


def run_seed(job: Job, draw: int, inputs: Inputs | None = None) -> tuple[Recording, Estimate]:
    """Run one seed; returns what the filter saw and what it made of it. What is raised is raised as it is."""
    inputs, scenario, method = inputs or shared_inputs(), job.scenario, job.method
    recording = inputs.recording(scenario, draw)
    attitude = inputs.attitude(recording, scenario.attitude)
    model = method.filter.of_seed(draw) if isinstance(method.filter, PerSeed) else method.filter
    if isinstance(model, Estimator):
        told = inputs.told(recording, method.r_scale)
        return recording, solution(told, attitude, model, method.adaptation, method.engine)
    timeline = told_timeline(inputs.timeline(recording, attitude), recording, attitude, method.r_scale)
    return recording, method.engine.run(timeline, model, method.adaptation)


def alone(job: Job, draw: int, options: RunOptions) -> NotedRows:
    """Return the row of a seed that is run alone."""
    evaluation = job.evaluation
    try:
        recording, estimate = run_seed(job, draw, options.inputs)
        if isinstance(job.method.filter, PerSeed):
            require_begin(estimate, recording, evaluation.burn_in_s)
        status, reason = run_status(estimate, recording, evaluation.divergence_limit_m)
        values = evaluate_run(estimate, recording, evaluation.burn_in_s, evaluation.metrics, options.inputs.columns)
        notes = [*notes_of(job, recording), *_covariance_notes(job, values, estimate)]
        return [{**_head(job, draw, status, reason), **values, **recording.parameters}], notes
    except Exception as error:  # noqa: BLE001 - whatever a plugin raises becomes a row, or a sentence
        return failed_piece(job, [draw], error, options)


def _covariance_notes(job: Job, values: Mapping[str, float], estimate: Estimate | None = None) -> list[str]:
    """Note a finite error whose ANEES is not finite, unless the filter estimates no covariance."""
    anees = values.get("anees_position", 0.0)
    estimated = estimate is None or bool(np.isfinite(estimate.covariance[:, :3, :3]).any())
    if np.isfinite(anees) or not estimated or not np.isfinite(values.get("position_rmse_m", np.nan)):
        return []
    cause = "Its covariance is not positive definite everywhere, for example after a long gap."
    return [f"The ANEES of {job.labels.filter} is not finite. {cause}"]


def failed_piece(job: Job, draws: Sequence[int], error: Exception, options: RunOptions) -> NotedRows:
    """Return the rows of seeds in which something was wrong, or raise it."""
    if options.strict:
        with plugins_in_words(job):
            raise error
    return failed_rows(job, draws, str(error) if isinstance(error, JerkbenchError) else reason_of(error)), []


def failed_rows(job: Job, draws: Sequence[int], reason: str) -> list[Row]:
    """Return rows of seeds of a job that could not be run."""
    return [_head(job, draw, "failed", reason) for draw in draws]


def _head(job: Job, draw: int, status: str, reason: str) -> Row:
    replicate = "seed" if job.scenario.seeded else "phase"
    return {**job.labels._asdict(), "seed": draw, "replicate": replicate, "status": status, "reason": plain(reason)}


def joined_pieces(several: Iterable[NotedRows]) -> NotedRows:
    """Return the rows of several pieces of a job as one, each note once."""
    rows, notes = zip(*several, strict=True)
    return [row for own in rows for row in own], list(dict.fromkeys(note for own in notes for note in own))


def solution(
    recording: Recording, attitude: Attitude, model: Filter | Estimator, adaptation: Adaptation, engine: Engine
) -> Estimate:
    """Return what a filter makes of a recording; an estimator goes its compiled way where the engine asks for it."""
    if not isinstance(model, Estimator):
        return engine.run(build_timeline(recording, attitude), model, adaptation)
    quick = None
    if isinstance(model, Batched) and isinstance(engine, SideBySide):
        quick = model.estimate_compiled(recording, attitude, adaptation)
    return model.estimate(recording, attitude, adaptation) if quick is None else quick


# Runs side by side: without trajectories, their metrics from sums.


def shared_call(job: Job) -> object:
    """Return what jobs of one scenario that may share a call have in common; a job by itself where none may."""
    if not streams(job) or unfit(job):
        return job
    method, of = job.method, job.evaluation
    return type(method.filter), type(method.adaptation), method.engine, of.metrics, of.burn_in_s, of.divergence_limit_m


def streams(job: Job) -> bool:
    """Whether the runs of ``job`` need no trajectories, and its engine or its estimator can do without."""
    able = has_methods(job.method.filter, Batched) or not isinstance(job.method.filter, Estimator)
    return able and has_methods(job.method.engine, SideBySide) and all(map(can_stream, job.evaluation.metrics))


def _together(jobs: Sequence[Job], draws: Sequence[int], options: RunOptions) -> list[NotedRows]:
    try:
        streamed = _streamed(jobs, draws, options)
    except Exception as error:  # noqa: BLE001 - whatever an engine raises becomes rows, or a sentence
        if len(jobs) == 1:
            return [failed_piece(jobs[0], draws, error, options)]
        return [piece for job in jobs for piece in _together([job], draws, options)]  # which tells the culprit
    return [
        joined_pieces(streamed.get((k, draw)) or alone(job, draw, options) for draw in draws)
        for k, job in enumerate(jobs)
    ]


_Notes = dict[object, list[str]]


class _ReadySeed(NamedTuple):
    """A seed, ready to run; R is as reported."""

    recording: Recording
    attitude: Attitude
    timeline: Timeline
    reference: PreparedReference


def _finished(job: Job, draw: int, seed: _ReadySeed, result: Streamed, options: RunOptions, notes: _Notes) -> NotedRows:
    """Return the row of a run among others that came to its end; ``notes`` has those of a seed that settings share."""
    reason, values = why_strayed(result, seed.reference, seed.recording), _values(job, seed, result, options.inputs)
    key = draw, job if has_methods(job.method.filter, Remarking) else job.labels.dataset
    own = notes.get(key) or notes.setdefault(key, notes_of(job, seed.recording))
    head = _head(job, draw, "diverged" if reason else "ok", reason)
    return [{**head, **values, **seed.recording.parameters}], [*own, *_covariance_notes(job, values)]


def _streamed(jobs: Sequence[Job], draws: Sequence[int], options: RunOptions) -> dict[tuple[int, int], NotedRows]:
    """Run ``draws`` of all ``jobs`` side by side; returns what came to its end, by the place of the job and the seed.

    The others (stopped, not to be scored without a trajectory, or with something wrong) are for the run alone: it says
    what is the matter. What the engine itself raises goes on to the caller.
    """
    every = {draw: _ready(jobs[0], draw, options.inputs) for draw in draws}
    ready = {(k, draw): seed for k in range(len(jobs)) for draw, seed in every.items() if seed is not None}
    if not ready:
        return {}
    results = _run_all([(jobs[k], seed) for (k, _), seed in ready.items()], options)
    notes: _Notes = {}
    return {
        (k, draw): _finished(jobs[k], draw, seed, result, options, notes)
        for ((k, draw), seed), result in zip(ready.items(), results, strict=True)
        if result is not None
    }


def _ready(job: Job, draw: int, inputs: Inputs) -> _ReadySeed | None:
    """Return what a run needs; None where something is wrong, which the run alone says."""
    try:
        recording = inputs.recording(job.scenario, draw)
        attitude = inputs.attitude(recording, job.scenario.attitude)
        timeline = inputs.timeline(recording, attitude)
    except Exception:  # noqa: BLE001 - the run alone raises it again, where it becomes a row that says so
        return None
    evaluation = job.evaluation
    reference = inputs.prepared(recording, timeline, evaluation.burn_in_s, evaluation.divergence_limit_m)
    return None if reference is None else _ReadySeed(recording, attitude, timeline, reference)


def _run_all(runs: Sequence[tuple[Job, _ReadySeed]], options: RunOptions) -> Sequence[Streamed | None]:
    """Run all of them in one call, in the estimator's own way or in the engine's."""
    first, _ = runs[0]
    reads = {part_read(metric) for metric in first.evaluation.metrics}
    updates, attitude = "updates" in reads, "attitude" in reads
    models: list[Any] = [job.method.filter for job, _ in runs]
    rules = [job.method.adaptation for job, _ in runs]
    whole, speeds = (
        any(getattr(metric, part, has_methods(metric, Summarising)) for metric in first.evaluation.metrics)
        for part in ("reads_covariance", "reads_velocity")
    )
    scoring = "scoring" if whole else "errors_alone" if speeds else "positions_alone"
    bare = [
        Run(
            told_timeline(seed.timeline, seed.recording, seed.attitude, job.method.r_scale),
            getattr(seed.reference, scoring),
        )
        for job, seed in runs
    ]
    if not isinstance(first.method.filter, Batched):
        engine = cast("SideBySide", first.method.engine)
        return engine.run_settings(bare, models, rules, updates=updates, threads=options.threads)
    recorded = [
        RecordedRun(seed.recording, seed.attitude, *run, job.method.r_scale)
        for (job, seed), run in zip(runs, bare, strict=True)
    ]
    return first.method.filter.run_settings(
        recorded, models, rules, updates=updates, attitude=attitude, threads=options.threads
    )


def _values(job: Job, seed: _ReadySeed, result: Streamed, inputs: Inputs) -> dict[str, float]:
    """Return the metrics of a run by column, from its sums."""
    outline = seed.reference.outline
    if result.euler_rad is not None:  # an attitude of its own
        outline = outlined(outline.index, result.euler_rad)
    if len(result.updates.t_s):
        outline = replace(outline, updates=result.updates)
    summary = Summary(outline, seed.reference.counted, sums_from(result, seed.reference, seed.recording))
    return metric_values(job.evaluation.metrics, summary, seed.recording, inputs.columns)
