"""Runs of a cell without trajectories: all seeds side by side, where engine and metrics can."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, cast

import numpy as np

from jerkbench.cells.cell import Cell
from jerkbench.contracts import Batched, Estimator, Filter, SideBySide
from jerkbench.estimate import Attitude
from jerkbench.evaluation.batch_scoring import can_stream, outlined, with_updates
from jerkbench.evaluation.divergence import strays
from jerkbench.evaluation.evaluated_run import Summary, values_of
from jerkbench.evaluation.sums import Scored, sums_from
from jerkbench.execution.inputs import Inputs
from jerkbench.optional import part_read
from jerkbench.recording import Recording
from jerkbench.streamed_run import RecordedRun, Run, Streamed
from jerkbench.timeline.timeline import Timeline


class Prepared(NamedTuple):
    """A seed, ready to run.

    Attributes:
        recording: what it is scored with.
        told: what the filter sees of it.
        attitude: of the recording.
        timeline: of what the filter sees.
        scored: how it is scored.
    """

    recording: Recording
    told: Recording
    attitude: Attitude
    timeline: Timeline
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
    batched = runs_compiled(cell) if isinstance(cell.filter, Estimator) else isinstance(cell.engine, SideBySide)
    return batched and all(map(can_stream, cell.metrics))


def runs_compiled(cell: Cell) -> bool:
    """Whether the estimator of ``cell`` has a compiled way, and the engine asks for it."""
    return isinstance(cell.filter, Batched) and isinstance(cell.engine, SideBySide)


def streamed_seeds(
    cell: Cell, draws: Sequence[int], fingerprint: str, threads: int, inputs: Inputs
) -> dict[int, StreamedSeed]:
    """Run ``draws`` side by side; returns what became of those that came to their end.

    The others (stopped, not to be scored without a trajectory, or with something wrong) are for the run alone: it says
    what is the matter. What the engine itself raises goes on to the caller.
    """
    every = {draw: prepared(cell, draw, fingerprint, inputs) for draw in draws}
    ready = {draw: seed for draw, seed in every.items() if seed is not None}
    results = _run_all(cell, list(ready.values()), threads)
    limit_m = cell.protocol.divergence_limit_m
    return {
        draw: StreamedSeed(seed.recording, streamed_values(cell, seed, result, inputs), strays(result, limit_m))
        for (draw, seed), result in zip(ready.items(), results, strict=True)
        if result is not None
    }


def _run_all(cell: Cell, seeds: Sequence[Prepared], threads: int) -> Sequence[Streamed | None]:
    """Run all seeds in the estimator's own way, or in the engine's."""
    reads = {part_read(metric) for metric in cell.metrics}
    updates, attitude = "updates" in reads, "attitude" in reads
    if isinstance(cell.filter, Batched):
        recorded = [RecordedRun(seed.told, seed.attitude, seed.timeline, seed.scored.scoring) for seed in seeds]
        return cell.filter.run_many(recorded, cell.adaptation, updates=updates, attitude=attitude, threads=threads)
    engine, model = cast("SideBySide", cell.engine), cast("Filter", cell.filter)
    runs = [Run(seed.timeline, seed.scored.scoring) for seed in seeds]
    return engine.run_many(runs, model, cell.adaptation, updates=updates, threads=threads)


def prepared(cell: Cell, draw: int, fingerprint: str, inputs: Inputs) -> Prepared | None:
    """Return what a run needs; None where something is wrong, which the run alone says."""
    try:
        recording = inputs.recording(cell, fingerprint, draw)
        attitude = inputs.attitude(recording, cell.attitude)
        told = inputs.told(recording, cell.r_scale)
        timeline = inputs.timeline(told, attitude)
    except Exception:  # noqa: BLE001 - the run alone raises it again, where it becomes a row that says so
        return None
    scored = inputs.scored(recording, timeline, cell.protocol.burn_in_s)
    return None if scored is None else Prepared(recording, told, attitude, timeline, scored)


def streamed_values(cell: Cell, seed: Prepared, result: Streamed, inputs: Inputs) -> dict[str, float]:
    """Return the metrics of a run by column, from its sums."""
    with np.errstate(over="ignore", invalid="ignore"):
        sums = sums_from(result, seed.scored, seed.recording)
    outline = seed.scored.outline
    if result.euler_rad is not None:  # an attitude of its own
        outline = outlined(outline.index, result.euler_rad)
    summary = Summary(with_updates(outline, result.updates), seed.scored.counted, sums)
    return values_of(cell.metrics, summary, seed.recording, inputs.columns)
