"""Table -> rich rendering for the terminal."""

import dataclasses
import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from jerkbench.plain import plain, styled
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.analysis.rows import metric_columns
from jerkbench.report.tables.narrow_layout import Block, blocks, groups, key_width, pieces
from jerkbench.report.tables.summary import main_metric, summarise, summarise_each
from jerkbench.report.tables.table_model import Table, TableCell

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import Console, Group
    from rich.table import Table as RichTable
    from rich.text import Text

MOST_ROWS = 500
"""Rows that a sweep prints at its end; what is longer nobody reads in a terminal."""


def print_table(rows: "pd.DataFrame", notes: Sequence[str] = (), metric: str | None = None) -> None:
    """Print the table of ``metric`` (default: `main_metric`) with ``notes``; in a pipe as wide as it has to be."""
    print_beginning(summarise(rows, metric or main_metric(rows), notes=notes))


def print_beginning(table: Table) -> None:
    """Print a table, of more than `MOST_ROWS` rows the first of them."""
    if len(table.rows) > MOST_ROWS:
        left_out = f"These are the first {MOST_ROWS} of {len(table.rows)} rows; table.md has all."
        first = table.rows[:MOST_ROWS], table.cells[:MOST_ROWS]
        table = dataclasses.replace(table, rows=first[0], cells=first[1], footnotes=(left_out, *table.footnotes))
    print_summary(table)


def print_summary(table: Table) -> None:
    """Print a table that is made already."""
    console = _console()
    _print(terminal_table(table, console.width if console.is_terminal else None))


def print_run(rows: "pd.DataFrame") -> None:
    """Print every metric that applies to one cell, and why runs of it went wrong."""
    grid = _grid()
    grid.add_column("metric")
    grid.add_column(f"{len(rows)} {'run' if len(rows) == 1 else 'runs'}")
    for table in summarise_each(rows, metric_columns(rows), row_keys=FACTORS[:-1], column_keys=FACTORS[-1:]):
        ((cell,),) = table.cells
        if cell is not None and cell.number != "n/a":
            grid.add_row(_plain(quantity(table.metric).heading), _text(cell))
    _print(_group(", ".join(f"{key} {rows[key].iloc[0]}" for key in FACTORS), [grid], _complaints(rows)))


def print_grid(title: str, header: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str] = ()) -> None:
    """Print lines of texts under a title and a header, with notes below."""
    grid = _grid()
    for text in header:
        grid.add_column(_plain(text))
    for row in rows:
        grid.add_row(*map(_plain, row))
    _print(_group(title, [grid], notes))


def terminal_table(table: Table, width: int | None) -> "Group":
    """Return title, table and footnotes for a rich console; repeated row headers are said once, trouble is red.

    Without a ``width`` (a pipe) nothing can be bold: the best stand between two stars each, as in Markdown, and every
    cell is one line.
    """
    if width is None:
        return _group(table.title, [_wide(table, plain=True)], table.footnotes)
    shown = blocks(table, width)
    parts = [_wide(table)] if not shown[0].widths else [part for block in shown for part in _narrow(table, block)]
    return _group(table.title, parts, table.footnotes)


def _wide(table: Table, *, plain: bool = False) -> "RichTable":
    """Return the whole table, each cell on one line."""
    grid = _grid()
    for k, header in enumerate(table.header):
        grid.add_column(_plain(header), no_wrap=k < len(table.row_keys))
    for values, cells in zip(table.sparse_rows, table.cells, strict=True):
        grid.add_row(*map(_plain, values), *(_text(cell, plain=plain) for cell in cells))
    return grid


def _narrow(table: Table, block: Block) -> "Iterator[RichTable | Text]":
    """Yield some columns of a table, the rows of each heading apart."""
    if block.columns[0]:
        yield _plain("")
    yield _head(table, block)
    for heading, rows in groups(table):
        if heading:
            yield _plain(heading, "italic")
        grid = _head(table, block, show=False)
        for row in rows:
            cells = table.cells[row]
            texts = (_text(cells[k], own) for k, own in zip(block.columns, block.widths, strict=True))
            grid.add_row(*map(_plain, table.rows[row][-1:]), *texts)
        yield grid


def _head(table: Table, block: Block, *, show: bool = True) -> "RichTable":
    """Return an empty grid of some columns, whose widths are fixed, with its head or without."""
    grid, keys = _grid(), len(table.row_keys)
    grid.show_header, grid.show_edge = show, False
    widths = [*([key_width(table)] if keys else []), *block.widths]
    names = [*table.header[max(0, keys - 1) : keys], *(table.header[keys + k] for k in block.columns)]
    for name, width in zip(names, widths, strict=True):
        grid.add_column(_plain(name), overflow="fold", min_width=width, max_width=width)
    return grid


def _grid() -> "RichTable":
    from rich import box
    from rich.table import Table as RichTable

    return RichTable(box=box.SIMPLE_HEAD, pad_edge=False)


def _group(title: str, parts: Sequence["RichTable | Text"], notes: Sequence[str]) -> "Group":
    from rich.console import Group

    return Group(_plain(title, "bold"), *parts, *map(_plain, notes))


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


def _complaints(rows: "pd.DataFrame") -> list[str]:
    """Return the reasons of the runs that did not go well."""
    wrong = rows[rows["status"] != "ok"]
    columns = (wrong["replicate"], wrong["seed"], wrong["status"], wrong["reason"])
    return [f"{replicate} {k} {status}: {reason}" for replicate, k, status, reason in zip(*columns, strict=True)]


def _plain(text: str, style: str = "") -> "Text":
    from rich.text import Text

    return Text(plain(text), style=style)


def _text(cell: TableCell | None, width: int = 0, *, plain: bool = False) -> "Text":
    """Return a cell as one line, or as lines of at most ``width`` characters."""
    from rich.text import Text

    lines = [(f"**{part}**", "") if plain and style == "bold" else (part, style) for part, style in pieces(cell, width)]
    return Text("\n" if width else " ").join(Text(part, style=style) for part, style in lines)
