"""The run of a cell: one row for each seed."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from jerkbench.cells.cell import Cell
from jerkbench.contracts import Batched, Estimator
from jerkbench.errors import JerkbenchError, PluginError
from jerkbench.estimate import Attitude, Estimate
from jerkbench.evaluation.run import evaluate_run, run_status
from jerkbench.execution import inputs
from jerkbench.execution.attitude_remarks import remarks_of
from jerkbench.execution.batches import StreamedSeed, runs_compiled, streamed_values, streams
from jerkbench.execution.plugin_errors import plugins_in_words, reason_of
from jerkbench.execution.plugin_probe import unfit
from jerkbench.plain import plain
from jerkbench.recording import Recording

Row = dict[str, Any]
Pieces = Iterator[tuple[list[Row], list[str]]]
"""Rows of some seeds that are done together, and what a reader of them has to know."""


def run_cell(cell: Cell, fingerprint: str, draws: Sequence[int] = (), threads: int = 1) -> tuple[list[Row], list[str]]:
    """Run the seeds of ``cell``; returns a row for each, and what a reader of them has to know.

    A run that raises is a row with the status "failed" and the reason.

    Args:
        cell: what to run.
        fingerprint: tells changed data apart.
        draws: which seeds; default: all of them.
        threads: how many the engine may use.
    """
    return _together(run_pieces(cell, fingerprint, draws or cell.draws, threads))


def run_open(cell: Cell, fingerprint: str, draws: Sequence[int] = (), threads: int = 1) -> tuple[list[Row], list[str]]:
    """The same, but what is wrong with the input or a plugin is raised, as a sentence.

    Raises:
        JerkbenchError: what is wrong.
    """
    return _together(run_open_pieces(cell, fingerprint, draws or cell.draws, threads))


def run_pieces(cell: Cell, fingerprint: str, draws: Sequence[int], threads: int = 1) -> Pieces:
    """`run_cell`, piece by piece: the seeds that run side by side, or one that runs alone."""
    if sentence := unfit(cell):
        yield failed_rows(cell, draws, sentence), []
        return
    yield from _pieces(cell, fingerprint, draws, threads, _guarded_row, guarded=True)


def run_open_pieces(cell: Cell, fingerprint: str, draws: Sequence[int], threads: int = 1) -> Pieces:
    """`run_open`, piece by piece.

    Raises:
        JerkbenchError: what is wrong with the input or a plugin.
    """
    if sentence := unfit(cell):
        raise PluginError(sentence)
    with plugins_in_words(cell):
        yield from _pieces(cell, fingerprint, draws, threads, _row, guarded=False)


def _together(pieces: Pieces) -> tuple[list[Row], list[str]]:
    rows: list[Row] = []
    notes: dict[str, None] = {}
    for new_rows, new_notes in pieces:
        rows += new_rows
        notes.update(dict.fromkeys(new_notes))
    return rows, list(notes)


class SingleSeed(NamedTuple):
    """A seed that has to be run alone: for its trajectory, or because something is the matter with it.

    Attributes:
        draw: which.
        values: its metrics, where they are known.
    """

    draw: int
    values: Mapping[str, float] | None = None


def _pieces(
    cell: Cell,
    fingerprint: str,
    draws: Sequence[int],
    threads: int,
    run_alone: Callable[[Cell, SingleSeed, str], tuple[Row, list[str]]],
    *,
    guarded: bool,
) -> Pieces:
    size = inputs.KEPT if streams(cell) else 1
    for begin in range(0, len(draws), size):
        block = draws[begin : begin + size]
        try:
            results = list(_results(cell, fingerprint, block, threads))
        except Exception as error:
            if not guarded:
                raise
            yield failed_rows(cell, block, _sentence(error)), []
            continue
        done = [
            run_alone(cell, result, fingerprint) if isinstance(result, SingleSeed) else result for result in results
        ]
        yield [row for row, _ in done], [note for _, notes in done for note in notes]


def _results(
    cell: Cell, fingerprint: str, draws: Sequence[int], threads: int
) -> Iterator[tuple[Row, list[str]] | SingleSeed]:
    """Row and notes of each draw that can go side by side with others; of another one, what to do alone."""
    done = streamed_values(cell, draws, fingerprint, threads) if streams(cell) else {}
    for draw in draws:
        yield _streamed_row(cell, draw, done[draw]) if draw in done else SingleSeed(draw)


def _streamed_row(cell: Cell, draw: int, streamed: StreamedSeed) -> tuple[Row, list[str]] | SingleSeed:
    if streamed.far:
        return SingleSeed(draw, streamed.values)
    return {**_head(cell, draw), "status": "ok", "reason": "", **streamed.values}, notes_of(cell, streamed.recording)


def _row(cell: Cell, single: SingleSeed, fingerprint: str) -> tuple[Row, list[str]]:
    recording, estimate = run_once(cell, single.draw, fingerprint)
    return row_of_run(cell, single, recording, estimate), notes_of(cell, recording)


def run_once(cell: Cell, draw: int, fingerprint: str) -> tuple[Recording, Estimate]:
    """Run one seed; returns what the filter saw and what it made of it."""
    recording = inputs.disturbed(cell.dataset, cell.disturbances, fingerprint, draw)
    attitude = inputs.attitude_of(recording, cell.attitude)
    if isinstance(cell.filter, Estimator):
        return recording, _estimated(cell, cell.filter, recording, attitude)
    timeline = inputs.timeline_of(recording, attitude)
    return recording, cell.engine.run(timeline, cell.filter, cell.adaptation)


def _estimated(cell: Cell, estimator: Estimator, recording: Recording, attitude: Attitude) -> Estimate:
    """In the compiled way where the engine asks for it and there is one."""
    quick = None
    if runs_compiled(cell) and isinstance(estimator, Batched):
        quick = estimator.estimate_compiled(recording, attitude, cell.adaptation)
    return estimator.estimate(recording, attitude, cell.adaptation) if quick is None else quick


def row_of_run(cell: Cell, single: SingleSeed, recording: Recording, estimate: Estimate) -> Row:
    """Return the row of one run."""
    protocol, values = cell.protocol, single.values
    status, reason = run_status(estimate, recording, protocol.divergence_limit_m)
    if values is None or estimate.failure:  # one that stops has the values up to there
        values = evaluate_run(estimate, recording, protocol.burn_in_s, cell.metrics, inputs.cached_values)
    return {**_head(cell, single.draw), "status": status, "reason": plain(reason), **values}


def failed_rows(cell: Cell, draws: Sequence[int], reason: str) -> list[Row]:
    """Rows of seeds of a cell that could not be run."""
    return [_failed(cell, draw, reason) for draw in draws]


def notes_of(cell: Cell, recording: Recording) -> list[str]:
    """Return notes on the source of the reference, and the recording's own; once for all its parameters."""
    return [plain(note) for note in _notes_of(cell, recording)]


def _notes_of(cell: Cell, recording: Recording) -> list[str]:
    reference, name = recording.reference, cell.labels.dataset.partition("(")[0]
    notes = [*(f"{name}: {note}" for note in recording.notes), *remarks_of(cell, recording)]
    if reference.empty:
        return [f"{name} has no reference: {reference.source}.", *notes]
    independence = "independent of" if reference.independent else "not independent of"
    source = f"Reference of {name}: {reference.source}; {independence} the measurements."
    return [source, *notes]


def _guarded_row(cell: Cell, single: SingleSeed, fingerprint: str) -> tuple[Row, list[str]]:
    try:
        return _row(cell, single, fingerprint)
    except Exception as error:  # noqa: BLE001 - whatever a plugin raises becomes a row that says so
        return _failed(cell, single.draw, _sentence(error)), []


def _sentence(error: Exception) -> str:
    return str(error) if isinstance(error, JerkbenchError) else reason_of(error)


def _failed(cell: Cell, draw: int, reason: str) -> Row:
    return {**_head(cell, draw), "status": "failed", "reason": plain(reason)}


def _head(cell: Cell, draw: int) -> Row:
    return {**cell.labels._asdict(), "seed": draw, "replicate": "seed" if cell.seeded else "phase"}
