"""Text of numbers: errors that name file and line, lines that were cut at either end, lines that name the columns."""

import re
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError

if TYPE_CHECKING:
    import pandas as pd

MAX_NUMBER = 1e15
"""Nothing that is measured on a vehicle is larger; what is larger is damage, and would overflow once squared."""

MAX_LINE_BYTES = 1 << 16
"""Bytes: a row of measurements is shorter by far, and one of megabytes takes minutes and gigabytes to cut up."""

Line = tuple[int, str]
"""A line's number in its file (from 1) and its text."""


def require_content(path: Path, *, text: bool = False) -> None:
    """Check in bounded memory that ``path`` can be read and is not empty; of a ``text``, that its lines are lines.

    Raises:
        RecordingError: there is no such file, it cannot be read, it is empty, or a line has more than 64 KiB.
    """
    blank, number = True, 0
    try:
        with path.open(encoding="latin-1") as file:
            while line := file.readline(MAX_LINE_BYTES + 2):
                blank, number = blank and not line.strip(), number + 1
                if not text and not blank:
                    return
                if text and len(line.rstrip("\n")) > MAX_LINE_BYTES:
                    raise RecordingError(
                        f"{path}, line {number} has more than {MAX_LINE_BYTES // 1024} KiB: this is no text of rows and"
                        " columns, or its line ends are lost; write it again, or name another file."
                    )
    except FileNotFoundError as error:
        raise RecordingError(f"There is no file {path}; check the folder and the file's name.") from error
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}.") from error
    if blank:
        raise RecordingError(f"{path} is empty; copy it again from where it was recorded.")


def read_bytes(path: Path) -> bytes:
    """Return the content of ``path``.

    Raises:
        RecordingError: there is no such file, it cannot be read, or it is empty.
    """
    require_content(path)
    return path.read_bytes()


def read_lines(path: Path) -> list[Line]:
    """Return the lines of ``path`` that are not blank; bytes that are no ASCII become a replacement character.

    Raises:
        RecordingError: as in `require_content`, of a text.
    """
    require_content(path, text=True)
    text = path.read_bytes().decode("ascii", errors="replace")
    return [(number, line) for number, line in enumerate(text.split("\n"), start=1) if line.strip()]


def parse_numbers(path: Path, lines: list[Line], columns: int, separator: str | None = None) -> FloatArray:
    """Return the numbers of ``lines`` as (n, columns); ``separator`` None: white space.

    Raises:
        RecordingError: there is no line, or one has another number of fields or a field that is no finite number.
    """
    if not lines:
        raise RecordingError(f"{path} has no rows of data; {columns} columns of numbers are expected.")
    table = np.empty((0, 0))
    if any(text.strip() for _, text in lines):  # else numpy warns
        with suppress(ValueError):
            table = np.loadtxt([text for _, text in lines], delimiter=separator, comments=None, ndmin=2)
    if table.shape != (len(lines), columns) or not (np.abs(table) <= MAX_NUMBER).all():
        raise RecordingError(_first_fault(path, lines, columns, separator))
    return table


def require_increasing(path: Path, lines: list[Line], times: np.ndarray, quantity: str) -> None:
    """Check that ``times``, one a line, increase.

    Raises:
        RecordingError: names the first line whose time does not.
    """
    back = np.flatnonzero(np.diff(times) <= 0)
    if back.size:
        raise RecordingError(
            f"{path}, line {lines[back[0] + 1][0]}: {quantity} does not increase; the line is damaged or out of order."
        )


def require_possible(where: str, values: FloatArray, most: float = MAX_NUMBER) -> None:
    """Check that no value (NaN aside) is beyond ``most``.

    Raises:
        RecordingError: names ``where`` and the first row.
    """
    beyond = np.abs(values.reshape(len(values), -1)) > most
    if beyond.any():
        row = int(np.argmax(beyond.any(axis=1)))
        raise RecordingError(f"{where}, row {row + 1} holds a value beyond {most:g}, which is damage or another unit.")


def _first_fault(path: Path, lines: list[Line], columns: int, separator: str | None) -> str:
    for number, text in lines:
        fields = text.split(separator)
        if len(fields) != columns:
            return f"{path}, line {number} has {len(fields)} fields; it must have {columns}: correct or remove it."
        for column, entry in enumerate(fields, start=1):
            if not (is_number(entry) and abs(float(entry)) <= MAX_NUMBER):
                field = f"{path}, line {number}, field {column} is '{entry.strip()}'"
                return f"{field}, not a finite number up to {MAX_NUMBER:g}: correct it."
    return f"{path} cannot be read as {columns} columns of numbers; copy it again from where it was recorded."


# The first and the last line of a log: the logger was switched on or off in the middle of them.

AROUND = 20
"""With so many lines beside it the first or the last one is compared."""

MIN_LINES = 4
"""Of fewer lines nobody can say which is whole."""


def cut_ends(lines: Sequence[str], separator: str | None) -> tuple[bool, bool]:
    """Return whether the first and whether the last of ``lines`` is a part of one only.

    A line is cut where it has fewer fields than each of its neighbours, or where its field at the cut, the first of the
    first line, the last of the last one, is no number and that of each neighbour is. A line of names is not cut.

    Args:
        lines: of data, in the order of the file.
        separator: between the fields; None: white space.
    """
    if len(lines) < MIN_LINES:
        return False, False
    around = min(AROUND, len(lines) - 2)
    after = [line.split(separator) for line in lines[: around + 1]]
    before = [line.split(separator) for line in lines[-around - 1 :]]
    return _cut(after[0], after[1:], 0), _cut(before[-1], before[:-1], -1)


def whole_lines(path: Path, lines: list[Line], separator: str | None = None) -> tuple[list[Line], tuple[str, ...]]:
    """Return the lines of ``path`` without a first and a last one that were cut, and a note that counts these."""
    first, last = cut_ends([text for _, text in lines], separator)
    return lines[first : len(lines) - last], cut_note(path.name, first=first, last=last)


def cut_note(name: str, *, first: bool, last: bool) -> tuple[str, ...]:
    """Return the note that counts the rows of the file ``name`` that were dropped, or none."""
    which = [word for word, cut in (("first", first), ("last", last)) if cut]
    if not which:
        return ()
    rows = "rows are" if which[1:] else "row is"
    return (f"{name}: the {' and the '.join(which)} {rows} not whole, as where a log was cut: {len(which)} dropped.",)


def is_number(entry: str) -> bool:
    """Whether an entry is a number."""
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


# A text of columns: lines that name the columns, lines of data, and lines that were cut.

_SAMPLE = 1 << 17
"""Bytes of each end of a file that are looked at before it is read."""

HEADER_LINES = 100
"""So many lines may stand above the data."""

PART_OF_NUMBERS = 0.5
"""A line is of data where more than this part of its fields are numbers or empty."""

_MARKS = "#%/! "
"""Letters that a line of names may begin with."""


@dataclass(frozen=True)
class TextFormat:
    """The format of a text of columns; Parquet and MATLAB files need none.

    Attributes:
        separator: between columns; empty: white space.
        header: whether a line may name the columns: the first above the data that has as many fields; others, such as
            a title or the units, are left out. Without a line above the data the columns are numbered.
        comment: what a line to be left out begins with; empty: nothing.
    """

    separator: str = ","
    header: bool = True
    comment: str = ""

    def fields(self, line: str) -> list[str]:
        """Return the fields of a line."""
        return [field.strip() for field in line.strip("\r\n").split(self.separator or None)]


def read_text(path: Path, text: TextFormat) -> tuple["pd.DataFrame", tuple[str, ...]]:
    """Return the table, and a note that counts rows that were cut, or none.

    Raises:
        RecordingError: the file is missing or empty, or a line of it is none.
        ValueError: pandas cannot read it; so are its ParserError, UnicodeError and others.
    """
    import pandas as pd

    require_content(path, text=True)
    lines, tail = _sample(path)
    use = [k for k, line in enumerate(lines) if line.strip() and not (text.comment and line.startswith(text.comment))]
    data = next((k for k in use[:HEADER_LINES] if _is_data(lines[k], text)), None)
    first = last = False
    named, skipped = text.header, []
    if data is not None:
        above = [k for k in use if k < data]
        names = _naming(above, lines, data, text) if text.header else None
        rows = [lines[k] for k in use if k >= data] + [line for line in tail if line.strip()]
        named = names is not None  # below a line of names a log begins with a whole row
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
    """Lines of the beginning, and, of a long file, whole lines of the end."""
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
    """Return the line above the data that names the columns: the first of as many fields, else the last of all."""
    count = len(text.fields(lines[data]))
    fitting = [k for k in above if len(text.fields(lines[k].lstrip(_MARKS))) == count]
    return fitting[0] if fitting else above[-1] if above else None
