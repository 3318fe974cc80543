"""A text of columns: lines that name the columns, lines of data, and lines that were cut."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from jerkbench.readers.cut_lines import LEAST_LINES, cut_ends, cut_note, is_number
from jerkbench.readers.text import require_content

if TYPE_CHECKING:
    import pandas as pd

SAMPLE = 1 << 17
"""Bytes of each end of a file that are looked at before it is read."""

HEADER_LINES = 100
"""So many lines may stand above the data."""

PART_OF_NUMBERS = 0.5
"""A line is of data where more than this part of its fields are numbers or empty."""

MARKS = "#%/! "
"""Letters that a line of names may begin with."""

BREAKS = ("\n", "\r")


@dataclass(frozen=True)
class TextFormat:
    """The format of a text of columns; Parquet and MATLAB files need none.

    Attributes:
        separator: between columns; empty: white space.
        header: whether a line names the columns: the first above the data that has as many fields; others, such as a
            title or the units, are left out.
        comment: what a line to be left out begins with; empty: nothing.
    """

    separator: str = ","
    header: bool = True
    comment: str = ""

    def fields(self, line: str) -> list[str]:
        """Return the fields of a line."""
        return [field.strip() for field in line.strip("\r\n").split(self.separator or None)]


@dataclass(frozen=True)
class Ends:
    """The begin and the end of a text.

    Attributes:
        skipped: numbers, from 0, of the lines above the data that name nothing, and of a first row that was cut.
        first: whether the first row was cut.
        last: whether the last row was.
    """

    skipped: tuple[int, ...]
    first: bool
    last: bool


def read_text(path: Path, text: TextFormat) -> tuple["pd.DataFrame", tuple[str, ...]]:
    """Return the table, and a note that counts rows that were cut, or none.

    Raises:
        RecordingError: the file is missing or empty, or a line of it is none.
        ValueError: pandas cannot read it; so are its ParserError, UnicodeError and others.
    """
    import pandas as pd

    require_content(path, text=True)
    ends = _ends(path, text)
    table = pd.read_csv(
        path,
        sep=text.separator or r"\s+",
        header=0 if text.header else None,
        comment=text.comment or None,
        skiprows=list(ends.skipped),
        skipinitialspace=True,
        index_col=False,
        low_memory=False,
    )
    if ends.last and len(table):
        table = table.iloc[:-1].infer_objects()
    return table, cut_note(path.name, first=ends.first, last=ends.last)


def _ends(path: Path, text: TextFormat) -> Ends:
    lines, tail = _sample(path)
    use = [k for k, line in enumerate(lines) if line.strip() and not (text.comment and line.startswith(text.comment))]
    data = next((k for k in use[:HEADER_LINES] if _is_data(lines[k], text)), None)
    if data is None:
        return Ends((), first=False, last=False)
    above = [k for k in use if k < data]
    names = _naming(above, lines, data, text) if text.header else None
    rows = [lines[k] for k in use if k >= data and not (text.header and names is None and k == data)]
    rows += [line for line in tail if line.strip()]
    first, last = cut_ends(rows, text.separator or None) if len(rows) >= LEAST_LINES else (False, False)
    first = first and not text.header  # below a line of names a log begins with a whole row
    skipped = [k for k in above if k != names] + ([data] if first else [])
    return Ends(tuple(skipped), first=first, last=last)


def _sample(path: Path) -> tuple[list[str], list[str]]:
    """Lines of the beginning, and, of a long file, whole lines of the end."""
    with path.open("rb") as file:
        head = file.read(SAMPLE)
        remaining = path.stat().st_size - len(head)
        file.seek(max(len(head), path.stat().st_size - SAMPLE))
        tail = file.read() if remaining > 0 else b""
    lines, after = _lines(head), _lines(tail)
    return (lines[:-1], after[1:]) if remaining > 0 else (lines, [])


def _lines(block: bytes) -> list[str]:
    return block.decode("utf-8", errors="replace").replace("\r\n", "\n").replace("\r", "\n").split("\n")


def _is_data(line: str, text: TextFormat) -> bool:
    fields = text.fields(line)
    return sum(not field or is_number(field) for field in fields) > PART_OF_NUMBERS * len(fields) and any(fields)


def _naming(above: Sequence[int], lines: Sequence[str], data: int, text: TextFormat) -> int | None:
    """Return the line above the data that names the columns: the first of as many fields, else the last of all."""
    count = len(text.fields(lines[data]))
    fitting = [k for k in above if len(text.fields(lines[k].lstrip(MARKS))) == count]
    return fitting[0] if fitting else above[-1] if above else None
