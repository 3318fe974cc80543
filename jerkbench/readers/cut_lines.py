"""The first and the last line of a log: the logger was switched on or off in the middle of them."""

from collections.abc import Sequence
from pathlib import Path

from jerkbench.readers.text import Line

AROUND = 20
"""With so many lines beside it the first or the last one is compared."""

LEAST_LINES = 4
"""Of fewer lines nobody can say which is whole."""


def cut_ends(lines: Sequence[str], separator: str | None) -> tuple[bool, bool]:
    """Return whether the first and whether the last of ``lines`` is a part of one only.

    A line is cut where it has fewer fields than each of its neighbours, or where its field at the cut, the first of the
    first line, the last of the last one, is no number and that of each neighbour is. A line of names is not cut.

    Args:
        lines: of data, in the order of the file.
        separator: between the fields; None: white space.
    """
    if len(lines) < LEAST_LINES:
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
