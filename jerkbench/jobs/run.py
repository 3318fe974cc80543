"""The loop of a sweep: the missing runs of a plan are computed, here or on a cluster, and stored as they come.

Several processes may write to one study. Each writes files of its own, and a row that exists twice counts once.
"""

import time
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from functools import partial
from typing import Any, NamedTuple, Self

import pyarrow as pa

from jerkbench.jobs.dispatch import outcomes
from jerkbench.jobs.executors import Workers
from jerkbench.jobs.job import Job
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.jobs.parts import RowBlock, table_of
from jerkbench.jobs.plan import Plan, chunks_of, missing
from jerkbench.jobs.progress import Progress
from jerkbench.jobs.rows import Result, Task, failed_rows, work
from jerkbench.jobs.store import Store

MAX_CHUNK_S = 10.0
"""A worker returns its results after this time, and the rest of its chunk is sent again, maybe to another worker, which
has to prepare its recordings once more. In this process each task is stored as it is finished."""

MIN_FLUSH_S, MAX_FLUSH_S = 1.0, 5.0
"""Rows are written in batches. The interval is 10 % of the elapsed time within these limits, so that a long sweep does
not leave thousands of small files. A process that is killed loses one interval."""
MAX_HELD_ROWS = 20_000
"""Rows that wait in memory to be written."""


def run_missing(
    plan: Plan,
    store: Store,
    workers: Workers | None = None,
    *,
    strict: bool = False,
    progress: Progress | None = None,
    threads: int = 1,
) -> None:
    """Compute the runs of a plan that are not stored, and store them. Damaged files are set aside.

    Args:
        plan: the jobs.
        store: their results.
        workers: where they run; default: this process.
        strict: raise an error of the input or of a plugin instead of storing it as a failed row.
        progress: a bar that is advanced for every finished job; default: a new one.
        threads: number of threads that the engine may use in each process.

    Raises:
        JerkbenchError: the results cannot be written, or as ``strict`` says.
        ClusterError: the cluster cannot continue. Finished runs are stored.
    """
    store.prepare()
    known = store.known([job.key for job in plan.jobs])
    to_do = {job.key: set(missing(job, known.get(job.key, ()))) for job in plan.jobs}
    done = sum(not seeds for seeds in to_do.values())
    chunks = chunks_of(plan.jobs, to_do, workers.count if workers else 1)
    made_by = origin()
    with nullcontext(progress) if progress else Progress(len(plan.jobs), done) as bar, Writer(store) as writer:
        bar.skip(done if progress else 0)
        pool = workers.pool(sum(map(len, chunks))) if workers and chunks else None
        limit_s = MAX_CHUNK_S if pool else 0.0
        compute = partial(run_tasks, made_by=made_by, strict=strict, threads=threads, limit_s=limit_s)
        for tasks, outcome in outcomes(compute, chunks, pool, Task.parts):
            if strict and isinstance(outcome, Exception):
                raise outcome
            rows = _failed(tasks[0], outcome, made_by) if isinstance(outcome, Exception) else outcome
            writer.add(rows.table)
            for key, statuses in rows.statuses:
                to_do[key].difference_update(statuses)
                bar.advance([*statuses.values()], count=not to_do[key])


class ComputedRows(NamedTuple):
    """The rows of some tasks.

    Attributes:
        statuses: for each job of each task its key, and the status of each seed.
        table: the rows as they are stored.
    """

    statuses: list[tuple[str, dict[int, str]]]
    table: pa.Table


def run_tasks(
    tasks: Sequence[Task], *, made_by: Mapping[str, Any], strict: bool, threads: int, limit_s: float
) -> tuple[int, ComputedRows]:
    """Run tasks for about ``limit_s``, at least one. Returns how many are finished, and their rows."""
    began, blocks, count = time.monotonic(), list[RowBlock](), 0
    for task in tasks:
        blocks += [
            block_of(*each, made_by) for each in zip(task.jobs, work(task, strict=strict, threads=threads), strict=True)
        ]
        count += 1
        if time.monotonic() - began >= limit_s:
            break
    return count, _rows(blocks)


def _failed(task: Task, error: Exception, made_by: Mapping[str, Any]) -> ComputedRows:
    reason = f"{type(error).__name__}: {error}"
    return _rows([block_of(job, Result(failed_rows(job, task.draws, reason), []), made_by) for job in task.jobs])


def _rows(blocks: Sequence[RowBlock]) -> ComputedRows:
    statuses = [(block.key, {row["seed"]: row["status"] for row in block.rows}) for block in blocks]
    return ComputedRows(statuses, table_of(blocks))


class Writer:
    """Writes rows into a store, those of many tasks into one file, and the last ones also after an error."""

    def __init__(self, store: Store) -> None:
        """Write into ``store``."""
        self._store, self._held, self._rows = store, list[pa.Table](), 0
        self._began = self._written = time.monotonic()

    def __enter__(self) -> Self:
        """Return the writer."""
        return self

    def __exit__(self, *_: object) -> None:
        """Write what is left."""
        self.flush()

    def add(self, table: pa.Table) -> None:
        """Take rows, and write them if the last file is old enough."""
        self._held.append(table)
        self._rows += len(table)
        now = time.monotonic()
        interval = min(max(0.1 * (now - self._began), MIN_FLUSH_S), MAX_FLUSH_S)
        if now - self._written > interval or self._rows > MAX_HELD_ROWS:
            self.flush()

    def flush(self) -> None:
        """Write a file."""
        if self._held:
            self._store.write_blocks((), self._held)
        self._held, self._rows, self._written = [], 0, time.monotonic()


def origin() -> dict[str, Any]:
    """Return the provenance that is stored with each run: code, versions, commit."""
    return {"code": code_digest(), "versions": versions(), "commit": git_commit()}


def block_of(job: Job, result: Result, made_by: Mapping[str, Any] | None = None) -> RowBlock:
    """Return the rows of a job as they are stored, with their provenance (default: `origin`)."""
    about = {
        "labels": job.labels._asdict(),
        "spec": job.spec,
        "protocol": job.evaluation.limits,
        "data": job.scenario.data,
        "notes": result.notes,
        **(made_by or origin()),
        "created": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "seconds": round(result.seconds + result.inputs_s, 3),
        "run_s": float(f"{result.seconds / len(result.rows):.4g}"),
        "processor": result.processor,
    }
    return RowBlock(job.key, len(job.draws), result.rows, about)
