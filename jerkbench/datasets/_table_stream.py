"""One stream of a table: where it stands, and what was read from there."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.errors import RecordingError
from jerkbench.readers.columns import Columns
from jerkbench.readers.cut_lines import cut_note

LEAST_STEPS = 4
"""Of fewer steps nobody can say which is odd."""

SOLUTION = ".pos"
"""Ending of RTKLIB's solutions, which say themselves what their columns are."""


@dataclass(frozen=True)
class Source:
    """Where a stream stands.

    Attributes:
        name: imu, position, velocity or reference.
        file: a name, or a pattern of several; empty: there is no such stream.
        time: column of its times; empty: they are in a file of dates.
        shift_s: added to its stamps.
        unit: of its times; empty: that of all streams.
        qualities: of a solution of RTKLIB, the values of Q that are used; empty: all.
    """

    name: str
    file: str
    time: str
    shift_s: float
    unit: str = ""
    qualities: tuple[float, ...] = ()

    @property
    def solved(self) -> bool:
        """Whether it is a solution of RTKLIB."""
        return self.file.endswith(SOLUTION)

    @property
    def parameter(self) -> str:
        """The parameter that names the file."""
        return f"{self.name}_file"

    @property
    def shift_ns(self) -> int:
        """Nanoseconds that are added to its stamps."""
        return round(self.shift_s * 1e9)


@dataclass(frozen=True, eq=False)
class Stream:
    """A file's columns with their stamps.

    Attributes:
        columns: the table, in the file's order.
        t_ns: (n,) stamps of the rows, shifted, since the files' own zero.
    """

    columns: Columns
    t_ns: IntArray

    def only(self, names: Sequence[str]) -> "Stream":
        """Return the rows in which the stream's columns ``names`` are not all empty: others belong to other streams.

        Raises:
            RecordingError: there is no such column, or it has no entry at all.
        """
        rows = self.columns.rows_of(names)
        if not rows.any():
            raise RecordingError(f"{self.columns.where} has no entry in {', '.join(names)}; name other columns.")
        return self if rows.all() else Stream(self.columns.only(rows), self.t_ns[rows])

    def whole(self) -> "Stream":
        """Return the stream without a first and a last row whose time alone was cut, and with a note that counts them.

        A time that lost its first digits is so early that the step after it is longer than all the rest; one that lost
        its last ones is before the row above.
        """
        steps = np.diff(self.t_ns)
        if len(steps) < LEAST_STEPS or (steps[1:-1] <= 0).any():
            return self
        first, last = bool(steps[0] > steps[1:-1].sum() + abs(steps[-1])), bool(steps[-1] < 0)
        rows = np.arange(len(self.t_ns))
        keep = (rows >= first) & (rows < len(rows) - last)
        notes = cut_note(Path(self.columns.where).name, first=first, last=last)
        return self if keep.all() else Stream(self.columns.only(keep).noted(notes), self.t_ns[keep])

    def t_s(self, zero_ns: int) -> FloatArray:
        """Return (n,) seconds since ``zero_ns``."""
        return np.asarray((self.t_ns - zero_ns) * 1e-9, dtype=np.float64)
