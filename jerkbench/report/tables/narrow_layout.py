"""The layout of a table where there is little room: cells of several lines, columns in several blocks."""

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from jerkbench.report.tables.table_model import ABSENT, Table, TableCell

GAP = 3
"""Characters between two columns."""

Piece = tuple[str, str]
"""A line of a cell, and its style."""


@dataclass(frozen=True)
class Block:
    """Columns that stand beside each other.

    Attributes:
        columns: their numbers.
        widths: of each, in characters; none where every cell is one line.
    """

    columns: tuple[int, ...]
    widths: tuple[int, ...] = ()


def blocks(table: Table, width: int) -> list[Block]:
    """Return how to show a table in ``width`` characters without breaking a number or an interval.

    Each cell is one line where all of them fit. Else number, interval, ratio and trouble stand below each other, the
    first row factors are headings, and columns that do not fit beside the others come in a block of their own.
    """
    everything = tuple(range(len(table.columns)))
    keys = sum(_key_width(table, k) + GAP for k in range(len(table.row_keys)))
    whole = [max(_header(table, k), *(len(text(cell)) for cell in _cells(table, k))) for k in everything]
    if keys + sum(whole) + GAP * len(whole) <= width:
        return [Block(everything)]
    stacked = [_stacked_width(table, k) for k in everything]
    last = key_width(table) + GAP if table.row_keys else 0
    return [Block(tuple(part), tuple(stacked[k] for k in part)) for part in parted(stacked, width - last, GAP)]


def groups(table: Table) -> list[tuple[str, tuple[int, ...]]]:
    """Return the rows under each heading, the values of all row factors but the last."""
    headings: dict[str, list[int]] = {}
    for place, row in enumerate(table.rows):
        headings.setdefault(", ".join(row[:-1]), []).append(place)
    return [(heading, tuple(places)) for heading, places in headings.items()]


def parted(widths: Sequence[float], room: float, gap: float) -> Iterator[range]:
    """Yield the numbers of as many columns as fit at a time, one at least."""
    begin, used = 0, 0.0
    for k, own in enumerate(widths):
        if k > begin and used + own + gap > room:
            yield range(begin, k)
            begin, used = k, 0.0
        used += own + gap
    yield range(begin, len(widths))


def pieces(cell: TableCell | None, width: int = 0) -> list[Piece]:
    """Return the parts of a cell with their styles: those of one line, or lines of at most ``width`` characters."""
    if cell is None:
        return [(ABSENT, "dim")]
    parts = [
        (cell.number, "bold" if cell.best else ""),
        (cell.interval, ""),
        (cell.factor, ""),
        (cell.trouble, "red"),
    ]
    told = [(part, style) for part, style in parts if part]
    if not width:
        return told
    return [(line, style) for part, style in told for line in textwrap.wrap(part, width, break_long_words=False)]


def text(cell: TableCell | None) -> str:
    """Return a cell on one line."""
    return ABSENT if cell is None else cell.text


def _cells(table: Table, column: int) -> list[TableCell | None]:
    return [row[column] for row in table.cells]


def key_width(table: Table) -> int:
    """Return the width of the last row factor, where columns stand in blocks; longer ones are folded."""
    return min(_key_width(table, len(table.row_keys) - 1), LONGEST_KEY)


def _key_width(table: Table, key: int) -> int:
    return max(len(table.row_keys[key]), *(len(row[key]) for row in table.rows), 0)


def _header(table: Table, column: int) -> int:
    return len(table.header[len(table.row_keys) + column])


def _stacked_width(table: Table, column: int) -> int:
    """Return the width of the widest part that must not be broken; headers and troubles break between words."""
    cells = [cell for cell in _cells(table, column) if cell is not None]
    whole = [len(part) for cell in cells for part in (cell.number, cell.interval, cell.factor)]
    words = [len(word) for cell in cells for word in cell.trouble.split()]
    return max(*whole, *words, min(_header(table, column), LONGEST_HEADER), 1)


LONGEST_KEY = 24
LONGEST_HEADER = 16
"""A longer one is folded where its column is narrower."""
