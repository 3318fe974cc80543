"""The notes on a cell: where the reference comes from, what the recording and its filters have to say."""

from collections.abc import Iterable

import numpy as np

from jerkbench.cells.cell import Cell
from jerkbench.contracts import Remarking
from jerkbench.execution.inputs import Inputs
from jerkbench.plain import plain
from jerkbench.recording import Recording

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
