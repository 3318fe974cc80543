"""Table -> rich rendering for the terminal, whatever its width: no number and no interval is broken."""

import dataclasses
import sys
import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from jerkbench.notices import plain, styled
from jerkbench.report.columns import FACTORS, metric_columns, quantity
from jerkbench.report.summary import main_metric, summarise
from jerkbench.report.table_model import ABSENT, Table, TextPart, arranged, parts

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import Console, Group
    from rich.table import Table as RichTable
    from rich.text import Text


MAX_ROWS = 500
"""Rows that a sweep prints at its end; what is longer nobody reads in a terminal."""

_GAP = 3
"""Characters between two columns."""

MAX_KEY_CHARACTERS, _MAX_HEADER_CHARACTERS = 24, 16
"""Characters; a longer row factor or header is folded where columns are narrow."""

_STYLES = {"best": "bold", "trouble": "red", "absent": "dim"}
"""Look of the parts of a cell; the others are plain."""

Block = tuple[tuple[int, int], ...]
"""Columns that stand beside each other, and the width of each in characters."""


def print_table(rows: "pd.DataFrame", notes: Sequence[str] = (), metric: str | None = None) -> None:
    """Print the table of ``metric`` (default: `main_metric`) with ``notes``; in a pipe as wide as it has to be."""
    print_beginning(summarise(rows, metric or main_metric(rows), notes=notes))


def print_beginning(table: Table) -> None:
    """Print a table, of more than `MAX_ROWS` rows the first of them."""
    if len(table.rows) > MAX_ROWS:
        left_out = f"These are the first {MAX_ROWS} of {len(table.rows)} rows; table.md has all."
        first = table.rows[:MAX_ROWS], table.cells[:MAX_ROWS]
        table = dataclasses.replace(table, rows=first[0], cells=first[1], footnotes=(left_out, *table.footnotes))
    print_summary(table)


def print_summary(table: Table) -> None:
    """Print a table that is made already."""
    console = _console()
    _print(terminal_table(table, console.width if console.is_terminal else None))


def print_run(rows: "pd.DataFrame") -> None:
    """Print every metric that applies to one cell, and why runs of it went wrong."""
    grid = _grid(["metric", f"{len(rows)} {'run' if len(rows) == 1 else 'runs'}"])
    numbers = arranged(rows, FACTORS[:-1], FACTORS[-1:])
    for metric in metric_columns(rows):
        (cell,) = numbers.cells(metric).values()
        if cell.number != "n/a":
            grid.add_row(_plain(quantity(metric).heading), _text(parts(cell)))
    wrong = rows[rows["status"] != "ok"]
    columns = (wrong["replicate"], wrong["seed"], wrong["status"], wrong["reason"])
    complaints = [f"{replicate} {k} {status}: {reason}" for replicate, k, status, reason in zip(*columns, strict=True)]
    _print(_group(", ".join(f"{key} {rows[key].iloc[0]}" for key in FACTORS), [grid], complaints))


def print_grid(title: str, header: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str] = ()) -> None:
    """Print lines of texts under a title and a header, with notes below."""
    grid = _grid(header)
    for row in rows:
        grid.add_row(*map(_plain, row))
    _print(_group(title, [grid], notes))


def terminal_table(table: Table, width: int | None) -> "Group":
    """Return title, table and footnotes for a rich console; repeated row headers are said once, trouble is red.

    Each cell is one line where all of them fit into ``width`` characters. Else number, interval, ratio and trouble
    stand below each other, the first row factors are headings, and columns that do not fit beside the others come in a
    block of their own. Without a ``width`` (a pipe) nothing can be bold: the best stand between two stars each, as in
    Markdown, and every cell is one line.
    """
    if width is None or not (narrow := blocks(table, width)):
        return _group(table.title, [_wide(table, plain=width is None)], table.footnotes)
    return _group(table.title, [part for block in narrow for part in _narrow(table, block)], table.footnotes)


def blocks(table: Table, width: int) -> list[Block]:
    """Return how to show a table in ``width`` characters, where its cells have several lines; empty where they fit."""
    keys, columns = len(table.row_keys), list(zip(*table.cells, strict=True))
    of_keys = [max(map(len, column)) for column in zip(table.row_keys, *table.rows, strict=True)]
    lines = [[cell.text if cell else ABSENT for cell in column] for column in columns]
    whole = [max(map(len, [*texts, head])) for texts, head in zip(lines, table.header[keys:], strict=True)]
    if sum(of_keys) + sum(whole) + _GAP * (keys + len(whole)) <= width:
        return []
    own = []
    for column, head in zip(columns, table.header[keys:], strict=True):
        told = [part for cell in column for part in parts(cell)]  # words of troubles may stand below each other
        words = [word for text, style in told for word in (text.split() if style == "trouble" else [text])]
        own.append(max(min(len(head), _MAX_HEADER_CHARACTERS), *map(len, words), 1))
    room = width - (min(of_keys[-1], MAX_KEY_CHARACTERS) + _GAP if keys else 0)
    parted: list[list[tuple[int, int]]] = [[]]
    for column in enumerate(own):
        if parted[-1] and sum(used + _GAP for _, used in parted[-1]) + column[1] + _GAP > room:
            parted.append([])
        parted[-1].append(column)
    return [tuple(block) for block in parted]


def groups(table: Table) -> list[tuple[str, tuple[int, ...]]]:
    """Return the rows under each heading, the values of all row factors but the last."""
    headings: dict[str, list[int]] = {}
    for place, row in enumerate(table.rows):
        headings.setdefault(", ".join(row[:-1]), []).append(place)
    return [(heading, tuple(places)) for heading, places in headings.items()]


def _wide(table: Table, *, plain: bool) -> "RichTable":
    """Return the whole table, each cell on one line."""
    grid = _grid(table.header, fixed=len(table.row_keys))
    for values, cells in zip(table.sparse_rows, table.cells, strict=True):
        grid.add_row(*map(_plain, values), *(_text(parts(cell), plain=plain) for cell in cells))
    return grid


def _narrow(table: Table, block: Block) -> "Iterator[RichTable | Text]":
    """Yield some columns of a table, the rows of each heading apart."""
    keys = len(table.row_keys)
    names = [*table.header[:keys][-1:], *(table.header[keys + k] for k, _ in block)]
    longest = [
        min(MAX_KEY_CHARACTERS, max(map(len, [name, *(row[-1] for row in table.rows)]))) for name in names[: keys > 0]
    ]
    widths = [*longest, *(own for _, own in block)]
    if block[0][0]:
        yield _plain("")
    yield _grid(names, widths)
    for heading, rows in groups(table):
        if heading:
            yield _plain(heading, "italic")
        grid = _grid(names, widths)
        grid.show_header = False
        for row in rows:
            grid.add_row(
                *map(_plain, table.rows[row][-1:]), *(_text(parts(table.cells[row][k]), own) for k, own in block)
            )
        yield grid


def _grid(names: Sequence[str], widths: Sequence[int] = (), fixed: int = 0) -> "RichTable":
    """Return an empty grid: of fixed widths, or as wide as it has to be, the first ``fixed`` columns unbroken."""
    from rich import box
    from rich.table import Table as RichTable

    grid = RichTable(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=not widths)
    for k, name in enumerate(names):
        grid.add_column(_plain(name), no_wrap=k < fixed)
    for column, width in zip(grid.columns, widths, strict=False):
        column.overflow, column.min_width, column.max_width = "fold", width, width
    return grid


def _group(title: str, drawn: Sequence["RichTable | Text"], notes: Sequence[str]) -> "Group":
    from rich.console import Group

    return Group(_plain(title, "bold"), *drawn, *map(_plain, notes))


def _console() -> "Console":
    from rich.console import Console

    return Console(file=styled(sys.stdout), highlight=False)


def _print(drawn: "Group") -> None:
    from rich.measure import Measurement

    console = _console()
    if not console.is_terminal:
        wide = console.options.update(width=10_000)
        console.width = max(120, Measurement.get(console, wide, drawn).maximum)
    console.print(drawn)


def _plain(text: str, style: str = "") -> "Text":
    from rich.text import Text

    return Text(plain(text), style=style)


def _text(told: Sequence[TextPart], width: int = 0, *, plain: bool = False) -> "Text":
    """Return a cell as one line, or as lines of at most ``width`` characters."""
    from rich.text import Text

    lines = [
        Text(f"**{line}**" if plain and style == "best" else line, style="" if plain else _STYLES.get(style, ""))
        for text, style in told
        for line in (textwrap.wrap(text, width, break_long_words=False) if width else [text])
    ]
    return Text("\n" if width else " ").join(lines)
