"""Readers of text files of numbers, which drop truncated lines at both ends and name the file and line in errors."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError

if TYPE_CHECKING:
    import pandas as pd

MAX_NUMBER = 1e15
"""Maximum plausible measurement on a vehicle. A larger value is damaged and may overflow when it is squared."""

_SAMPLE = 1 << 17
"""Number of bytes at each end of a file that are examined before it is read."""

Line = tuple[int, str]
"""A line's number in its file (from 1) and its text."""


def require_content(path: Path) -> None:
    """Check that the file is readable and not empty.

    Raises:
        RecordingError: the file does not exist, cannot be read, or contains only white space.
    """
    try:
        with path.open("rb") as file:
            blank = not any(block.strip() for block in iter(lambda: file.read(_SAMPLE), b""))
    except FileNotFoundError as error:
        raise RecordingError(f"There is no file {path}; check the folder and the file's name.") from error
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}.") from error
    if blank:
        raise RecordingError(f"{path} is empty; copy the file again from its source.")


def read_bytes(path: Path) -> bytes:
    """Return the content of a file, which must not be empty.

    Raises:
        RecordingError: the file does not exist, cannot be read, or is empty.
    """
    require_content(path)
    return path.read_bytes()


def read_lines(path: Path) -> list[Line]:
    """Return the lines of a file that are not blank. Non-ASCII bytes become a replacement character.

    Raises:
        RecordingError: the file does not exist, cannot be read, or is empty.
    """
    text = read_bytes(path).decode("ascii", errors="replace")
    return [(number, line) for number, line in enumerate(text.split("\n"), start=1) if line.strip()]


def require_possible(where: str, values: FloatArray, most: float = MAX_NUMBER) -> None:
    """Check that no absolute value exceeds ``most``. NaN is allowed.

    Raises:
        RecordingError: an absolute value exceeds ``most``. The error message names ``where`` and the first row with
            such a value.
    """
    beyond = np.abs(values.reshape(len(values), -1)) > most
    if beyond.any():
        row = int(np.argmax(beyond.any(axis=1)))
        raise RecordingError(f"{where}, row {row + 1} has a value beyond {most:g}; it is damaged or in another unit.")


# The first and the last line of a log may be truncated, because the logger was switched on or off.

AROUND = 20
"""Number of neighbouring lines with which the first line and the last line are compared."""

MIN_LINES = 4
"""Minimum number of lines in which a truncated line can be identified."""


def cut_ends(lines: Sequence[str], separator: str | None) -> tuple[bool, bool]:
    """Return whether the first and the last of ``lines`` are truncated.

    A line is truncated if it has fewer fields than each of its neighbours. A line is also truncated if its outer field
    (the first field of the first line, the last field of the last line) is not a number, but the same field of each
    neighbour is a number. A line of column names does not count as truncated.

    Args:
        lines: lines of data, in the order of the file.
        separator: separator of the fields, or None for white space.
    """
    if len(lines) < MIN_LINES:
        return False, False
    around = min(AROUND, len(lines) - 2)
    after = [line.split(separator) for line in lines[: around + 1]]
    before = [line.split(separator) for line in lines[-around - 1 :]]
    return _cut(after[0], after[1:], 0), _cut(before[-1], before[:-1], -1)


def cut_note(name: str, *, first: bool, last: bool) -> tuple[str, ...]:
    """Return a note if the ``first`` or ``last`` row of the file ``name`` was dropped, otherwise an empty tuple."""
    which = [end for end, cut in (("first", first), ("last", last)) if cut]
    if not which:
        return ()
    rows = "rows are" if which[1:] else "row is"
    return (f"{name}: the {' and the '.join(which)} {rows} truncated: {len(which)} dropped.",)


def is_number(entry: str) -> bool:
    """Return whether an entry is a number. Python numbers with underscores, such as 1_000, do not count."""
    try:
        float(entry)
    except ValueError:
        return False
    return "_" not in entry


def _cut(row: Sequence[str], neighbours: Sequence[Sequence[str]], end: int) -> bool:
    if len(row) < min(map(len, neighbours)):
        return True
    names = not any(map(is_number, row))
    return not names and not is_number(row[end]) and all(is_number(neighbour[end]) for neighbour in neighbours)


# A text file of columns: header lines, lines of data, and truncated lines.

HEADER_LINES = 100
"""Maximum number of lines above the data."""

PART_OF_NUMBERS = 0.5
"""Minimum fraction of fields of a line of data that are numbers or empty."""

_MARKS = "#%/! "
"""Characters that a line of names may start with."""


@dataclass(frozen=True)
class TextFormat:
    """The format of a text file of columns, which is not used for Parquet and MATLAB files.

    Attributes:
        separator: separator of the columns, or empty for white space.
        header: whether a line above the data names the columns. The header is the first line with as many fields as the
            data. Other lines above the data, such as a title or the units, are ignored. Without a line above the data,
            the columns are numbered.
        comment: start of the lines that are ignored, or empty to ignore no lines.
    """

    separator: str = ","
    header: bool = True
    comment: str = ""

    def fields(self, line: str) -> list[str]:
        """Return the fields of a line without surrounding white space."""
        return [field.strip() for field in line.strip("\r\n").split(self.separator or None)]


def read_text(path: Path, text: TextFormat) -> tuple["pd.DataFrame", tuple[str, ...]]:
    """Read a text file of columns. Return the table, and a note that counts truncated rows, if any.

    Raises:
        RecordingError: the file is missing or empty.
        ValueError: pandas cannot read the file (ParserError, UnicodeError and others are subclasses).
    """
    import pandas as pd

    require_content(path)
    lines, tail = _sample(path)
    use = [k for k, line in enumerate(lines) if line.strip() and not (text.comment and line.startswith(text.comment))]
    data = next((k for k in use[:HEADER_LINES] if _is_data(lines[k], text)), None)
    first = last = False
    named, skipped = text.header, []
    if data is not None:
        above = [k for k in use if k < data]
        names = _naming(above, lines, data, text) if text.header else None
        rows = [lines[k] for k in use if k >= data] + [line for line in tail if line.strip()]
        named = names is not None  # the first row below a header is never truncated
        first, last = (cut and not (named and k == 0) for k, cut in enumerate(cut_ends(rows, text.separator or None)))
        skipped = [k for k in above if k != names] + ([data] if first else [])
    table = pd.read_csv(
        path,
        sep=text.separator or r"\s+",
        header=0 if named else None,
        comment=text.comment or None,
        skiprows=skipped,
        skipinitialspace=True,
        index_col=False,
        low_memory=False,
    )
    if last and len(table):
        table = table.iloc[:-1].infer_objects()
    return table, cut_note(path.name, first=first, last=last)


def _sample(path: Path) -> tuple[list[str], list[str]]:
    """Return complete lines from the start of a file and, if the file is long, complete lines from its end."""
    with path.open("rb") as file:
        head = file.read(_SAMPLE)
        file.seek(max(len(head), path.stat().st_size - _SAMPLE))
        blocks = [block.decode("utf-8", errors="replace") for block in (head, file.read())]
    lines, after = (re.split(r"\r\n|\r|\n", block) for block in blocks)
    return (lines[:-1], after[1:]) if blocks[1] else (lines, [])


def _is_data(line: str, text: TextFormat) -> bool:
    fields = text.fields(line)
    return sum(not field or is_number(field) for field in fields) > PART_OF_NUMBERS * len(fields) and any(fields)


def _naming(above: Sequence[int], lines: Sequence[str], data: int, text: TextFormat) -> int | None:
    """Return the index of the header: the first line with as many fields as the data, or the line above the data."""
    count = len(text.fields(lines[data]))
    fitting = [k for k in above if len(text.fields(lines[k].lstrip(_MARKS))) == count]
    return fitting[0] if fitting else above[-1] if above else None
