"""Several .pos files of one drive, one after the other -> one solution."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from jerkbench.errors import RecordingError
from jerkbench.readers.gpst import GPST_MINUS_UTC_S
from jerkbench.readers.rtklib_pos import PosSolution, read_rtklib_pos


def read_pos_files(paths: Sequence[Path], gpst_minus_utc_s: float = GPST_MINUS_UTC_S) -> PosSolution:
    """Read the files one after the other into one solution.

    Raises:
        RecordingError: a file is missing or damaged, begins before the one before it ends, or is alone with velocities.
    """
    solutions = [read_rtklib_pos(path, gpst_minus_utc_s) for path in paths]
    _require_order(paths, solutions)
    _require_the_same(paths, solutions)
    return _joined(solutions) if len(solutions) > 1 else solutions[0]


def _require_order(paths: Sequence[Path], solutions: Sequence[PosSolution]) -> None:
    for k in range(1, len(paths)):
        if solutions[k].gpst_ns[0] <= solutions[k - 1].gpst_ns[-1]:
            raise RecordingError(
                f"{paths[k]} begins before {paths[k - 1]} ends, and files that fit a pattern are read one after the"
                " other, by their names; name one of them, or remove or rename the odd one."
            )


def _require_the_same(paths: Sequence[Path], solutions: Sequence[PosSolution]) -> None:
    """Check that all files have velocities or none has, and that all are in ECEF or none is."""
    for content, present in (
        ("velocities", [solution.velocity_enu_mps is not None for solution in solutions]),
        ("ECEF", [solution.axes_at is not None for solution in solutions]),
    ):
        if any(present) and not all(present):
            has, lacks = paths[present.index(True)], paths[present.index(False)]
            raise RecordingError(
                f"{has} has {content}, {lacks} has none: they cannot be read one after the other; let RTKLIB write both"
                " alike, or name one of them."
            )


def _joined(solutions: Sequence[PosSolution]) -> PosSolution:
    """The rows of all, vectors of ECEF along the axes at the first fix of the first."""
    first = solutions[0]
    alike = [vars(s if s.axes_at is None else s.with_axes_at(first.first)) for s in solutions]
    names = [name for name, values in vars(first).items() if isinstance(values, np.ndarray)]
    whole: dict[str, Any] = {name: np.concatenate([values[name] for values in alike]) for name in names}
    notes = tuple(note for solution in solutions for note in solution.notes)
    return replace(first, **whole, axes_at=None if first.axes_at is None else first.first, notes=notes)
