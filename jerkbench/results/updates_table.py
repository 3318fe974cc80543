"""The updates of a run as CSV: innovations, NIS, and the measurement noise that was used."""

from pathlib import Path

import numpy as np

from jerkbench.errors import JerkbenchError
from jerkbench.estimate import Updates
from jerkbench.files import write_text

MEASURED = tuple(
    f"{name}_{axis}_{unit}"
    for name, unit in (("position", "m"), ("velocity", "mps"))
    for axis in ("east", "north", "up")
)
"""The six rows of a measurement, with their unit."""

COLUMNS = (
    *("t_s", "rows", "nis", "nis_used"),
    *(f"innovation_{name}" for name in MEASURED),
    *(f"sigma_used_{name}" for name in MEASURED),
)


def write_updates(path: Path, updates: Updates) -> None:
    """Write a line for each update, with all digits.

    ``sigma_used`` is the square root of the diagonal of the R that was used: that of the adaptation, infinite where it
    dropped the row. What was not measured is empty. ``nis`` is of the reported R, ``nis_used`` of the used one.

    Raises:
        JerkbenchError: there is no update.
    """
    if not len(updates.t_s):
        raise JerkbenchError("The run has no update of which anything is kept, so there is nothing to write.")
    head = np.column_stack([updates.t_s, updates.rows, updates.nis, updates.nis_used])
    table = np.hstack([head, updates.innovation, np.sqrt(updates.R_diagonal)])
    lines = [",".join("" if np.isnan(value) else repr(value) for value in line) for line in table.tolist()]
    write_text(path, "\n".join([",".join(COLUMNS), *lines, ""]))
