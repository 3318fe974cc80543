"""What stands above the figures of one run."""

import textwrap
from dataclasses import replace

from jerkbench.benchmark.cell import Cell
from jerkbench.recording import Recording

WIDTH = 70
"""Letters of a line: as many as a figure has room for."""


def titled(recording: Recording, cell: Cell, draw: int) -> Recording:
    """Return the recording with a name that says its disturbance too (if any), and its seed or phase."""
    disturbance = cell.labels.disturbance
    disturbed = () if disturbance == "none" else (disturbance,)
    drawn = (f"seed {draw}",) if cell.seeded else (f"phase {draw}",) if len(cell.draws) > 1 else ()
    return replace(recording, name=textwrap.fill(", ".join((recording.name, *disturbed, *drawn)), WIDTH))
