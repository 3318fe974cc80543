"""Print tables in a terminal of any width. Numbers and intervals are never broken over two lines."""

import dataclasses
import math
import re
import sys
from collections.abc import Iterable, Iterator, Sequence
from textwrap import shorten, wrap
from typing import TYPE_CHECKING

from jerkbench.errors import plain, styled
from jerkbench.report.columns import FACTORS, metric_columns, quantity
from jerkbench.report.summary import GEOMETRIC_NOTE
from jerkbench.report.table_model import Table, TableCell, arranged, parts

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import Console, Group
    from rich.table import Table as RichTable
    from rich.text import Text


MAX_ROWS = 500
"""Maximum number of rows that a sweep prints at its end."""

MAX_NOTE_LINES = 3
"""Maximum number of lines of notes below a table without the option ``--notes``."""

_IMPORTANCE = (
    r"^These are the first|^Diverged or failed|^Failed: |damaged file|tuned on the seeds|versions of the code",
    r"left out|not independent|^Worse",
    r"95 % interval|one recording|^Tuned by",
    r"^(?!In every cell|Bold|\*: |gm: |n/a: |No interval|–: |×r|Not as published|Reference of .*: simulated)",  # noqa: RUF001
    r"significant",
)
"""Patterns of notes, the most important notes for the interpretation of the numbers first.

The fourth pattern matches notes about the recordings and the methods of a study.
"""

_STYLES = {"best": "bold", "trouble": "red", "absent": "dim"}
"""Rich style of each kind of text in a cell. Kinds of text that are not listed have no style."""


def print_table(
    table: Table, all_notes: str, *, wide: bool = False, every_note: bool = False, max_rows: int | None = None
) -> None:
    """Print a table with its most important notes. If the output is a pipe, each cell is printed on one line.

    Args:
        table: table to print.
        all_notes: how the user can print all notes, for the line about the other notes.
        wide: whether to print the geometric mean in addition to the median.
        every_note: whether to print all notes.
        max_rows: maximum number of rows to print, or None to print all rows.
    """
    if max_rows is not None and len(table.rows) > max_rows:
        left_out = f"These are the first {max_rows} of {len(table.rows)} rows; table.md has all."
        first = table.rows[:max_rows], table.cells[:max_rows]
        table = dataclasses.replace(table, rows=first[0], cells=first[1], footnotes=(left_out, *table.footnotes))
    table = table if wide else without_geometric(table)
    console = _console()
    width = console.width if console.is_terminal else None
    notes = table.footnotes if every_note else shown_notes(table.footnotes, all_notes, width)
    _print(terminal_table(dataclasses.replace(table, footnotes=tuple(notes)), width))


def without_geometric(table: Table) -> Table:
    """Return a table without geometric means and without the note that explains them.

    A geometric mean remains if the median run of the cell failed, because no other number describes the successful
    runs.
    """
    cells = [[_without_geometric(cell) for cell in row] for row in table.cells]
    remains = any(cell.geometric_text for row in cells for cell in row if cell is not None)
    notes = tuple(note for note in table.footnotes if remains or note != GEOMETRIC_NOTE)
    return dataclasses.replace(table, cells=tuple(map(tuple, cells)), footnotes=notes)


def _without_geometric(cell: TableCell | None) -> TableCell | None:
    return cell if cell is None or math.isinf(cell.mean) else cell._replace(geometric=math.nan)


def shown_notes(notes: Sequence[str], all_notes: str, width: int | None) -> list[str]:
    """Return the most important notes, one line each, and a line with the number of the other notes."""
    if len(notes) <= MAX_NOTE_LINES and sum(len(wrap(note, width or len(note))) for note in notes) <= MAX_NOTE_LINES:
        return list(notes)
    rank = {
        note: next((k for k, p in enumerate(_IMPORTANCE) if re.search(p, note)), len(_IMPORTANCE)) for note in notes
    }
    first = sorted(notes, key=rank.__getitem__)[: MAX_NOTE_LINES - 1]
    lines = [note if width is None else shorten(note, width, placeholder=" ...") for note in first]
    left = len(notes) - len(first)
    others = f"{left} more note{'s' * (left > 1)}" if left else "The complete notes"
    return [*lines, f"{others}: {all_notes}"]


def print_run(rows: "pd.DataFrame") -> None:
    """Print all applicable metrics of one combination, and the reasons of its diverged and failed runs."""
    grid = _grid(["metric", f"{len(rows)} {'run' if len(rows) == 1 else 'runs'}"])
    numbers = arranged(rows, FACTORS[:-1], FACTORS[-1:])
    for metric in metric_columns(rows):
        (cell,) = numbers.cells(metric).values()
        if cell.number != "n/a":
            grid.add_row(_plain(quantity(metric).heading), _text(_without_geometric(cell)))
    wrong = rows[rows["status"] != "ok"]
    columns = (wrong["replicate"], wrong["seed"], wrong["status"], wrong["reason"])
    complaints = [f"{replicate} {k} {status}: {reason}" for replicate, k, status, reason in zip(*columns, strict=True)]
    _print(_group(", ".join(f"{key} {rows[key].iloc[0]}" for key in FACTORS), [grid], complaints))


def print_grid(title: str, header: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str] = ()) -> None:
    """Print rows of texts with a title, a header, and notes below."""
    grid = _grid(header)
    for row in rows:
        grid.add_row(*map(_plain, row))
    _print(_group(title, [grid], notes))


def terminal_table(table: Table, width: int | None) -> "Group":
    """Return the title, the table and the footnotes in a form that a rich console prints.

    Row labels that repeat the row above are omitted. Failures are printed in red. If the table does not fit into
    ``width`` characters, the labels of each row become a heading, and each cell of the row is one line below it. If
    ``width`` is None (for a pipe), the best cells are marked by asterisks as in Markdown.
    """
    grid = _grid(table.header, fixed=len(table.row_keys))
    for values, cells in zip(table.sparse_rows, table.cells, strict=True):
        grid.add_row(*map(_plain, values), *(_text(cell, plain=width is None) for cell in cells))
    fits = width is None or _measured(grid) <= width
    return _group(table.title, [grid] if fits else _lines(table), table.footnotes)


def _lines(table: Table) -> "Iterator[Text]":
    names = table.header[len(table.row_keys) :]
    for values, cells in zip(table.rows, table.cells, strict=True):
        yield _plain(", ".join(map(" ".join, zip(table.row_keys, values, strict=True))), "italic")
        for name, cell in zip(names, cells, strict=True):
            if cell is not None:
                yield _plain(f"  {name:<{max(map(len, names))}}  ") + _text(cell)


def _grid(names: Sequence[str], fixed: int = 0) -> "RichTable":
    """Return an empty grid. The text in its first ``fixed`` columns is never wrapped."""
    from rich import box
    from rich.table import Table as RichTable

    grid = RichTable(box=box.SIMPLE_HEAD, pad_edge=False)
    for k, name in enumerate(names):
        grid.add_column(_plain(name), no_wrap=k < fixed)
    return grid


def _group(title: str, drawn: "Iterable[RichTable | Text]", notes: Sequence[str]) -> "Group":
    from rich.console import Group

    return Group(_plain(title, "bold"), *drawn, *map(_plain, notes))


def _console() -> "Console":
    from rich.console import Console

    return Console(file=styled(sys.stdout), highlight=False)


def _measured(drawn: "Group | RichTable") -> int:
    """Return the minimum width [characters] at which no line of a table is wrapped."""
    from rich.measure import Measurement

    console = _console()
    return Measurement.get(console, console.options.update(width=10_000), drawn).maximum


def _print(drawn: "Group") -> None:
    console = _console()
    if not console.is_terminal:
        console.width = max(120, _measured(drawn))
    console.print(drawn)


def _plain(text: str, style: str = "") -> "Text":
    from rich.text import Text

    return Text(plain(text), style=style)


def _text(cell: TableCell | None, *, plain: bool = False) -> "Text":
    """Return the text of a cell as one line."""
    from rich.text import Text

    texts = [
        Text(f"**{text}**" if plain and style == "best" else text, style="" if plain else _STYLES.get(style, ""))
        for text, style in parts(cell)
    ]
    return Text(" ").join(texts)
