"""Runs become rows: the seeds and the settings of a cell side by side where its plugins can, else one at a time."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from operator import methodcaller
from typing import Any, Literal, NamedTuple, cast

import numpy as np

from jerkbench.contracts import Adaptation, Batched, Engine, Estimator, Filter, PerSeed, Reading, Remarking, SideBySide
from jerkbench.errors import JerkbenchError, PluginError
from jerkbench.estimate import Attitude, Estimate
from jerkbench.evaluation.counted_rows import require_begin
from jerkbench.evaluation.evaluated_run import Summary, evaluate_run, metric_values, run_status, strays
from jerkbench.evaluation.sums import Scored, can_stream, outlined, sums_from, with_updates
from jerkbench.jobs.cell import Cell
from jerkbench.jobs.inputs import KEPT, Inputs, shared_inputs
from jerkbench.jobs.preflight import plugins_in_words, reason_of, unfit
from jerkbench.optional import part_read
from jerkbench.plain import plain
from jerkbench.recording import Recording
from jerkbench.sums import RecordedRun, Run, Streamed
from jerkbench.timeline import Timeline, build_timeline, told_timeline

# The notes on a cell: where the reference comes from, what the recording and its filters have to
# say.

GAP_S = 0.2
"""A longer step between two samples of the IMU is told: in it a vehicle turns and brakes."""


def notes_of(cell: Cell, recording: Recording) -> list[str]:
    """Return what stands under the table of a cell; once for all its parameters."""
    return [plain(note) for note in (*_reference_notes(cell, recording), *_remarks(cell, recording))]


def first_remarks(cells: Iterable[tuple[Cell, str]], inputs: Inputs) -> list[str]:
    """Return what is to be said of recorded drives before they run; simulated ones are remarked on under the table.

    Args:
        cells: what is going to run, each with the fingerprint of its data.
        inputs: recordings that are shared.
    """
    answered: set[object] = set()
    lines: dict[str, None] = {}
    for cell, fingerprint in cells:
        question = cell.dataset, cell.disturbances, cell.attitude
        if cell.dataset.seeded or question in answered:
            continue
        answered.add(question)
        lines.update(dict.fromkeys(_of_first_seed(cell, fingerprint, inputs)))
    return list(lines)


def _of_first_seed(cell: Cell, fingerprint: str, inputs: Inputs) -> list[str]:
    if not isinstance(cell.attitude, Remarking):
        return []
    try:
        return _remarks(cell, inputs.recording(cell, fingerprint, cell.draws[0]))
    except Exception:  # noqa: BLE001 - what cannot be loaded becomes a row that says so, when it is run
        return []


def _reference_notes(cell: Cell, recording: Recording) -> list[str]:
    reference, name = recording.reference, _name(cell)
    notes = [f"{name}: {note}" for note in (*recording.notes, *_gaps(recording))]
    if reference.empty:
        return [f"{name} has no reference: {reference.source}.", *notes]
    independence = "independent of" if reference.independent else "not independent of"
    return [f"Reference of {name}: {reference.source}; {independence} the measurements.", *notes]


def _gaps(recording: Recording) -> list[str]:
    if recording.imu is None:
        return []
    steps_s = np.diff(recording.imu.t_s)
    gaps_s = steps_s[steps_s > max(GAP_S, 2.5 * recording.imu.nominal_interval_s)]
    if not len(gaps_s):
        return []
    count = "1 gap" if len(gaps_s) == 1 else f"{len(gaps_s)} gaps"
    lost = "one sample stands for all: a turn or a change of speed there is lost, for every filter that uses the IMU"
    return [f"the IMU has {count} of up to {gaps_s.max():.2f} s, in which {lost}. Cut the recording there."]


def _remarks(cell: Cell, recording: Recording) -> list[str]:
    of_attitude = cell.attitude.remarks(recording) if isinstance(cell.attitude, Remarking) else ()
    of_filter = cell.filter.remarks(recording) if isinstance(cell.filter, Remarking) else ()
    return [*(f"{_name(cell)}: {remark}" for remark in of_attitude), *of_filter]


def _name(cell: Cell) -> str:
    """The data set's name, without its parameters."""
    return cell.labels.dataset.partition("(")[0]


Row = dict[str, Any]
Piece = tuple[list[Row], list[str]]
"""Rows of some seeds that are done together, and what a reader of them has to know."""
OnError = Literal["row", "raise"]
OK = {"status": "ok", "reason": ""}


@dataclass(frozen=True, eq=False)
class CellRun:
    """A cell that is run.

    Attributes:
        cell: what to run.
        fingerprint: tells changed data apart.
        on_error: what becomes of an error in the input or a plugin: a row with the status "failed" and the reason
            ("row"), or a JerkbenchError that is raised, in words ("raise").
        threads: how many the engine may use.
        inputs: recordings, attitudes and timelines; default: those that all cells of this process share.
    """

    cell: Cell
    fingerprint: str
    on_error: OnError = "row"
    threads: int = 1
    inputs: Inputs = field(default_factory=shared_inputs)

    def rows(self, draws: Sequence[int] = ()) -> Piece:
        """Return a row for each seed of ``draws`` (default: all), and what a reader of them has to know.

        Raises:
            JerkbenchError: what is wrong, unless it is to be a row.
        """
        return joined(self.pieces(draws or self.cell.draws))

    def begin(self, draw: int) -> None:
        """Have the recording and the attitude of a seed in memory; what is wrong with them is said by its run."""
        with suppress(Exception):
            self.inputs.attitude(self.inputs.recording(self.cell, self.fingerprint, draw), self.cell.attitude)

    def pieces(self, draws: Sequence[int]) -> Iterator[Piece]:
        """`rows`, piece by piece: the seeds that run side by side, or one that runs alone.

        Raises:
            JerkbenchError: as above.
        """
        yield from (piece for (piece,) in pieces([self], draws))

    def once(self, draw: int) -> tuple[Recording, Estimate]:
        """Run one seed; returns what the filter saw and what it made of it. What is raised is raised as it is."""
        cell, inputs = self.cell, self.inputs
        recording = inputs.recording(cell, self.fingerprint, draw)
        attitude = inputs.attitude(recording, cell.attitude)
        model = cell.filter.of_seed(draw) if isinstance(cell.filter, PerSeed) else cell.filter
        if isinstance(model, Estimator):
            told = inputs.told(recording, cell.r_scale)
            return recording, solution(told, attitude, model, cell.adaptation, cell.engine)
        timeline = told_timeline(inputs.timeline(recording, attitude), recording, attitude, cell.r_scale)
        return recording, cell.engine.run(timeline, model, cell.adaptation)

    def finished(self, draw: int, streamed: "_Sums | None") -> Piece:
        """Return the row of a seed; one that stopped, or went too far, is run alone, which says where and when."""
        if streamed is None or streamed.far:
            return self.alone(draw, streamed.values if streamed else None)
        return [{**_head(self.cell, draw), **OK, **streamed.values}], notes_of(self.cell, streamed.recording)

    def alone(self, draw: int, values: Mapping[str, float] | None = None) -> Piece:
        """Return the row of a seed that is run alone; ``values`` are its metrics, where they are known."""
        protocol = self.cell.protocol
        try:
            recording, estimate = self.once(draw)
            if isinstance(self.cell.filter, PerSeed):
                require_begin(estimate, recording, protocol.burn_in_s)
            status, reason = run_status(estimate, recording, protocol.divergence_limit_m)
            if values is None or estimate.failure:  # one that stops has the values up to there
                values = evaluate_run(estimate, recording, protocol.burn_in_s, self.cell.metrics, self.inputs.columns)
            row = {**_head(self.cell, draw), "status": status, "reason": plain(reason), **values}
            return [row], notes_of(self.cell, recording)
        except Exception as error:  # noqa: BLE001 - whatever a plugin raises becomes a row, or a sentence
            return self.failed([draw], error)

    def failed(self, draws: Sequence[int], error: Exception) -> Piece:
        """Return the rows of seeds in which something was wrong, or raise it."""
        if self.on_error == "raise":
            with plugins_in_words(self.cell):
                raise error
        return failed_rows(self.cell, draws, str(error) if isinstance(error, JerkbenchError) else reason_of(error)), []


def pieces(runs: Sequence[CellRun], draws: Sequence[int]) -> Iterator[list[Piece]]:
    """Yield a piece for each of some cells that may share a call: of the seeds that run side by side, or of one.

    Args:
        runs: of one `lane`, with the same data and inputs.
        draws: seeds, or phases.
    """
    if sentence := unfit(runs[0].cell):
        yield [run.failed(draws, PluginError(sentence)) for run in runs]
        return
    together = streams(runs[0].cell)
    for begin in range(0, len(draws), KEPT if together else 1):
        block = draws[begin : begin + (KEPT if together else 1)]
        yield _side_by_side(runs, block) if together else list(map(methodcaller("alone", block[0]), runs))


def _side_by_side(runs: Sequence[CellRun], draws: Sequence[int]) -> list[Piece]:
    first = runs[0]
    try:
        streamed = _streamed([run.cell for run in runs], draws, first.fingerprint, first.threads, first.inputs)
    except Exception as error:  # noqa: BLE001 - whatever an engine raises becomes rows, or a sentence
        if len(runs) == 1:
            return [first.failed(draws, error)]
        return [piece for run in runs for piece in _side_by_side([run], draws)]  # which tells the culprit
    return [joined(run.finished(draw, streamed.get((k, draw))) for draw in draws) for k, run in enumerate(runs)]


def joined(several: Iterable[Piece]) -> Piece:
    """Return the rows of several pieces of a cell as one, each note once."""
    rows, notes = zip(*several, strict=True)
    return [row for own in rows for row in own], list(dict.fromkeys(note for own in notes for note in own))


def lane(cell: Cell) -> object:
    """Return what cells of one scenario that may share a call have in common; a cell by itself where none may."""
    if not streams(cell) or unfit(cell):
        return cell
    return type(cell.filter), type(cell.adaptation), cell.engine, cell.metrics, cell.protocol


def streams(cell: Cell) -> bool:
    """Whether the runs of ``cell`` need no trajectories, and its engine can do without."""
    batched = runs_compiled(cell) if isinstance(cell.filter, Estimator) else isinstance(cell.engine, SideBySide)
    return batched and all(map(can_stream, cell.metrics))


def runs_compiled(cell: Cell) -> bool:
    """Whether the estimator of ``cell`` has a compiled way, and the engine asks for it."""
    return isinstance(cell.filter, Batched) and isinstance(cell.engine, SideBySide)


def failed_rows(cell: Cell, draws: Sequence[int], reason: str) -> list[Row]:
    """Return rows of seeds of a cell that could not be run."""
    return [{**_head(cell, draw), "status": "failed", "reason": plain(reason)} for draw in draws]


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


def _head(cell: Cell, draw: int) -> Row:
    return {**cell.labels._asdict(), "seed": draw, "replicate": "seed" if cell.seeded else "phase"}


class _Prepared(NamedTuple):
    """A seed, ready to run; R is as reported."""

    recording: Recording
    attitude: Attitude
    timeline: Timeline
    scored: Scored


class _Sums(NamedTuple):
    """The result of a run among others: its metrics by column, and whether the position went beyond the limit."""

    recording: Recording
    values: Mapping[str, float]
    far: bool


def _streamed(
    cells: Sequence[Cell], draws: Sequence[int], fingerprint: str, threads: int, inputs: Inputs
) -> dict[tuple[int, int], _Sums]:
    """Run ``draws`` of all ``cells`` side by side; returns what came to its end, by the place of the cell and the seed.

    The others (stopped, not to be scored without a trajectory, or with something wrong) are for the run alone: it says
    what is the matter. What the engine itself raises goes on to the caller.
    """
    every = {draw: _prepared(cells[0], draw, fingerprint, inputs) for draw in draws}
    ready = {(k, draw): seed for k in range(len(cells)) for draw, seed in every.items() if seed is not None}
    if not ready:
        return {}
    results = _run_all([(cells[k], seed) for (k, _), seed in ready.items()], threads, inputs)
    limit_m = cells[0].protocol.divergence_limit_m
    return {
        (k, draw): _Sums(seed.recording, _values(cells[k], seed, result, inputs), strays(result, limit_m))
        for ((k, draw), seed), result in zip(ready.items(), results, strict=True)
        if result is not None
    }


def _prepared(cell: Cell, draw: int, fingerprint: str, inputs: Inputs) -> _Prepared | None:
    """Return what a run needs; None where something is wrong, which the run alone says."""
    try:
        recording = inputs.recording(cell, fingerprint, draw)
        attitude = inputs.attitude(recording, cell.attitude)
        timeline = inputs.timeline(recording, attitude)
    except Exception:  # noqa: BLE001 - the run alone raises it again, where it becomes a row that says so
        return None
    scored = inputs.scored(recording, timeline, cell.protocol.burn_in_s)
    return None if scored is None else _Prepared(recording, attitude, timeline, scored)


def _run_all(runs: Sequence[tuple[Cell, _Prepared]], threads: int, inputs: Inputs) -> Sequence[Streamed | None]:
    """Run all of them in one call, in the estimator's own way or in the engine's."""
    first, _ = runs[0]
    reads = {part_read(metric) for metric in first.metrics}
    updates, attitude = "updates" in reads, "attitude" in reads
    models: list[Any] = [cell.filter for cell, _ in runs]
    rules = [cell.adaptation for cell, _ in runs]
    nees = any(getattr(metric, "reads_nees", not isinstance(metric, Reading)) for metric in first.metrics)
    bare = [Run(_told(cell, seed), seed.scored.scoring if nees else seed.scored.errors_alone) for cell, seed in runs]
    if not isinstance(first.filter, Batched):
        engine = cast("SideBySide", first.engine)
        return engine.run_settings(bare, models, rules, updates=updates, threads=threads)
    recorded = [
        RecordedRun(inputs.told(seed.recording, cell.r_scale), seed.attitude, *run)
        for (cell, seed), run in zip(runs, bare, strict=True)
    ]
    return first.filter.run_settings(recorded, models, rules, updates=updates, attitude=attitude, threads=threads)


def _told(cell: Cell, seed: _Prepared) -> Timeline:
    return told_timeline(seed.timeline, seed.recording, seed.attitude, cell.r_scale)


def _values(cell: Cell, seed: _Prepared, result: Streamed, inputs: Inputs) -> dict[str, float]:
    """Return the metrics of a run by column, from its sums."""
    with np.errstate(over="ignore", invalid="ignore"):
        sums = sums_from(result, seed.scored, seed.recording)
    outline = seed.scored.outline
    if result.euler_rad is not None:  # an attitude of its own
        outline = outlined(outline.index, result.euler_rad)
    summary = Summary(with_updates(outline, result.updates), seed.scored.counted, sums)
    return metric_values(cell.metrics, summary, seed.recording, inputs.columns)
