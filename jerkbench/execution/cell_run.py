"""The run of a cell: one row for each seed."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from jerkbench.cells.cell import Cell
from jerkbench.contracts import Adaptation, Batched, Engine, Estimator, Filter, PerSeed, SideBySide
from jerkbench.errors import JerkbenchError, PluginError
from jerkbench.estimate import Attitude, Estimate
from jerkbench.evaluation.counted_rows import require_begin
from jerkbench.evaluation.divergence import run_status
from jerkbench.evaluation.evaluated_run import evaluate_run
from jerkbench.execution.batches import StreamedSeed, streamed_seeds, streams
from jerkbench.execution.inputs import KEPT, Inputs, shared_inputs
from jerkbench.execution.notes import notes_of
from jerkbench.execution.plugin_errors import plugins_in_words, reason_of
from jerkbench.execution.plugin_probe import unfit
from jerkbench.plain import plain
from jerkbench.recording import Recording
from jerkbench.timeline.timeline import Timeline, build_timeline

Row = dict[str, Any]
Piece = tuple[list[Row], list[str]]
"""Rows of some seeds that are done together, and what a reader of them has to know."""
Pieces = Iterator[Piece]


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
    on_error: Literal["row", "raise"] = "row"
    threads: int = 1
    inputs: Inputs = field(default_factory=shared_inputs)

    def rows(self, draws: Sequence[int] = ()) -> Piece:
        """Return a row for each seed of ``draws`` (default: all), and what a reader of them has to know.

        Raises:
            JerkbenchError: what is wrong, unless it is to be a row.
        """
        rows: list[Row] = []
        notes: dict[str, None] = {}
        for new_rows, new_notes in self.pieces(draws or self.cell.draws):
            rows += new_rows
            notes.update(dict.fromkeys(new_notes))
        return rows, list(notes)

    def pieces(self, draws: Sequence[int]) -> Pieces:
        """`rows`, piece by piece: the seeds that run side by side, or one that runs alone.

        Raises:
            JerkbenchError: as above.
        """
        if sentence := unfit(self.cell):
            yield self._failed(draws, PluginError(sentence))
            return
        together = streams(self.cell)
        for begin in range(0, len(draws), KEPT if together else 1):
            block = draws[begin : begin + (KEPT if together else 1)]
            yield self._side_by_side(block) if together else self._row(block[0])

    def once(self, draw: int) -> tuple[Recording, Estimate]:
        """Run one seed; returns what the filter saw and what it made of it. What is raised is raised as it is."""
        cell, inputs = self.cell, self.inputs
        recording = inputs.recording(cell, self.fingerprint, draw)
        attitude = inputs.attitude(recording, cell.attitude)
        model = cell.filter.of_seed(draw) if isinstance(cell.filter, PerSeed) else cell.filter
        told = inputs.told(recording, cell.r_scale)
        return recording, solution(told, attitude, model, cell.adaptation, cell.engine, inputs.timeline)

    def _side_by_side(self, draws: Sequence[int]) -> Piece:
        try:
            streamed = streamed_seeds(self.cell, draws, self.fingerprint, self.threads, self.inputs)
        except Exception as error:  # noqa: BLE001 - whatever an engine raises becomes rows, or a sentence
            return self._failed(draws, error)
        rows, notes = zip(*(self._streamed_row(draw, streamed.get(draw)) for draw in draws), strict=True)
        return [row for (row,) in rows], [note for row_notes in notes for note in row_notes]

    def _streamed_row(self, draw: int, streamed: StreamedSeed | None) -> Piece:
        """A seed that stopped, or went too far, is run alone, which says where and when."""
        if streamed is None or streamed.far:
            return self._row(draw, streamed.values if streamed else None)
        return [{**_head(self.cell, draw), **OK, **streamed.values}], notes_of(self.cell, streamed.recording)

    def _row(self, draw: int, values: Mapping[str, float] | None = None) -> Piece:
        """Run a seed alone; ``values`` are its metrics, where they are known."""
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
            return self._failed([draw], error)

    def _failed(self, draws: Sequence[int], error: Exception) -> Piece:
        if self.on_error == "raise":
            with plugins_in_words(self.cell):
                raise error
        return failed_rows(self.cell, draws, str(error) if isinstance(error, JerkbenchError) else reason_of(error)), []


OK = {"status": "ok", "reason": ""}


def failed_rows(cell: Cell, draws: Sequence[int], reason: str) -> list[Row]:
    """Return rows of seeds of a cell that could not be run."""
    return [{**_head(cell, draw), "status": "failed", "reason": plain(reason)} for draw in draws]


def solution(
    recording: Recording,
    attitude: Attitude,
    model: Filter | Estimator,
    adaptation: Adaptation,
    engine: Engine,
    timeline: Callable[[Recording, Attitude], Timeline] = build_timeline,
) -> Estimate:
    """Return what a filter makes of a recording; an estimator goes its compiled way where the engine asks for it."""
    if not isinstance(model, Estimator):
        return engine.run(timeline(recording, attitude), model, adaptation)
    quick = None
    if isinstance(model, Batched) and isinstance(engine, SideBySide):
        quick = model.estimate_compiled(recording, attitude, adaptation)
    return model.estimate(recording, attitude, adaptation) if quick is None else quick


def _head(cell: Cell, draw: int) -> Row:
    return {**cell.labels._asdict(), "seed": draw, "replicate": "seed" if cell.seeded else "phase"}
