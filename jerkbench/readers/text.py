"""Text files of numbers, with errors that name file and line."""

from contextlib import suppress
from pathlib import Path

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError

LARGEST = 1e15
"""Nothing that is measured on a vehicle is larger; what is larger is damage, and would overflow once squared."""

LONGEST_LINE = 1 << 16
"""Bytes: a row of measurements is shorter by far, and one of megabytes takes minutes and gigabytes to cut up."""

BLOCK = 1 << 20

Line = tuple[int, str]
"""A line's number in its file (from 1) and its text."""


def require_content(path: Path, *, text: bool = False) -> None:
    """Check in bounded memory that ``path`` can be read and is not empty; of a ``text``, that its lines are lines.

    Raises:
        RecordingError: there is no such file, it cannot be read, it is empty, or a line has more than 64 KiB.
    """
    blank, line, length = True, 1, 0
    try:
        with path.open("rb") as file:
            while block := file.read(BLOCK):
                blank = blank and not block.strip()
                if not text and not blank:
                    return
                line, length = _require_lines(path, block, line, length)
    except FileNotFoundError as error:
        raise RecordingError(f"There is no file {path}; check the folder and the file's name.") from error
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}.") from error
    if blank:
        raise RecordingError(f"{path} is empty; copy it again from where it was recorded.")


def _require_lines(path: Path, block: bytes, line: int, length: int) -> tuple[int, int]:
    """Number and length so far of the last line of a block, which continues the ``line`` of ``length``."""
    octets = np.frombuffer(block, dtype=np.uint8)
    ends = np.flatnonzero((octets == ord("\n")) | (octets == ord("\r")))
    lengths = np.diff(np.concatenate([[-1 - length], ends, [len(block)]])) - 1
    long = np.flatnonzero(lengths > LONGEST_LINE)
    if long.size:
        number = line + block[: ends[long[0] - 1] + 1].count(b"\n") if long[0] else line
        raise RecordingError(
            f"{path}, line {number} has more than {LONGEST_LINE // 1024} KiB: this is no text of rows and columns, or"
            " its line ends are lost; write it again, or name another file."
        )
    return line + block.count(b"\n"), int(lengths[-1])


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
    if table.shape != (len(lines), columns) or not (np.abs(table) <= LARGEST).all():
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


def require_possible(where: str, values: FloatArray, most: float = LARGEST) -> None:
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
            if not _is_number(entry):
                return (
                    f"{path}, line {number}, field {column} is '{entry.strip()}', not a finite number up to"
                    f" {LARGEST:g}: correct it."
                )
    return f"{path} cannot be read as {columns} columns of numbers; copy it again from where it was recorded."


def _is_number(entry: str) -> bool:
    try:
        return abs(float(entry)) <= LARGEST and "_" not in entry
    except ValueError:
        return False
