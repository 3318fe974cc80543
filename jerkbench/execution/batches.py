"""Runs of a cell without trajectories: all seeds side by side, where engine and metrics can."""

from collections.abc import Hashable, Mapping, Sequence
from typing import Any, NamedTuple, cast

import numpy as np

from jerkbench.batch import Run, Streamed
from jerkbench.cells.cell import Cell
from jerkbench.contracts import Estimator, Metric, SideBySide, Summarising
from jerkbench.evaluation.batch_scoring import Scored, can_stream, sums_from, with_updates
from jerkbench.evaluation.run import gathered
from jerkbench.execution import inputs
from jerkbench.optional import part_read
from jerkbench.recording import Recording


class Prepared(NamedTuple):
    """A seed, ready to run."""

    recording: Recording
    run: Run
    scored: Scored


class StreamedSeed(NamedTuple):
    """The result of a seed that ran side by side with others.

    Attributes:
        recording: what the filter saw.
        values: the metrics by column.
        far: whether the position went beyond the limit; where and when, a trajectory says.
    """

    recording: Recording
    values: Mapping[str, float]
    far: bool


def streams(cell: Cell) -> bool:
    """Whether the runs of ``cell`` need no trajectories, and its engine can do without."""
    kinematic = not isinstance(cell.filter, Estimator)
    return kinematic and isinstance(cell.engine, SideBySide) and all(map(can_stream, cell.metrics))


def streamed_values(cell: Cell, draws: Sequence[int], fingerprint: str, threads: int) -> dict[int, StreamedSeed]:
    """Run ``draws`` side by side; returns what became of those that came to their end.

    The others (stopped, not to be scored without a trajectory, or with something wrong) are for the run alone: it says
    what is the matter. What the engine itself raises goes on to the caller.
    """
    prepared = {draw: seed_run for draw in draws if (seed_run := _prepared(cell, draw, fingerprint)) is not None}
    updates = any(part_read(metric) == "updates" for metric in cell.metrics)
    runs = [seed_run.run for seed_run in prepared.values()]
    engine: Any = cell.engine
    results = engine.run_many(runs, cell.filter, cell.adaptation, updates=updates, threads=threads)
    limit_m2 = cell.protocol.divergence_limit_m**2
    return {
        draw: StreamedSeed(seed_run.recording, _values(cell, seed_run, result), result.farthest_m2 > limit_m2)
        for (draw, seed_run), result in zip(prepared.items(), results, strict=True)
        if result is not None
    }


def _prepared(cell: Cell, draw: int, fingerprint: str) -> Prepared | None:
    try:
        recording = inputs.disturbed(cell.dataset, cell.disturbances, fingerprint, draw)
        timeline = inputs.timeline_of(recording, inputs.attitude_of(recording, cell.attitude))
    except Exception:  # noqa: BLE001 - the run alone raises it again, where it becomes a row that says so
        return None
    scored = inputs.scored_of(recording, timeline, cell.protocol.burn_in_s)
    return None if scored is None else Prepared(recording, Run(timeline, scored.scoring), scored)


def _values(cell: Cell, seed_run: Prepared, result: Streamed) -> dict[str, float]:
    with np.errstate(over="ignore", invalid="ignore"):
        sums = sums_from(result, seed_run.scored, seed_run.recording)
    estimate = with_updates(seed_run.scored.outline, result.updates)

    def columns(metric: Metric) -> Mapping[str, float]:
        """Return the columns of ``metric``, in the units of their names, from the least that it needs."""
        if isinstance(metric, Summarising):
            return metric.summarise(sums)
        if part_read(metric) == "attitude":
            return inputs.attitude_columns(cast("Hashable", metric), seed_run.scored, seed_run.recording)
        return metric.evaluate(estimate, seed_run.recording, seed_run.scored.counted)

    return gathered((metric, columns(metric)) for metric in cell.metrics)
