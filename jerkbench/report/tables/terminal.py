"""Table -> rich rendering for the terminal."""

import dataclasses
import sys
from collections.abc import Sequence
from typing import TYPE_CHECKING

from jerkbench.plain import plain, styled
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.analysis.rows import metric_columns
from jerkbench.report.tables.summary import main_metric, summarise, summarise_each
from jerkbench.report.tables.table_model import ABSENT, Table, TableCell

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
    _print(terminal_table(table, plain=not _console().is_terminal))


def print_run(rows: "pd.DataFrame") -> None:
    """Print every metric that applies to one cell, and why runs of it went wrong."""
    grid = _grid()
    grid.add_column("metric")
    grid.add_column(f"{len(rows)} {'run' if len(rows) == 1 else 'runs'}")
    for table in summarise_each(rows, metric_columns(rows), row_keys=FACTORS[:-1], column_keys=FACTORS[-1:]):
        ((cell,),) = table.cells
        if cell is not None and cell.number != "n/a":
            grid.add_row(_plain(quantity(table.metric).heading), _text(cell))
    _print(_group(", ".join(f"{key} {rows[key].iloc[0]}" for key in FACTORS), grid, _complaints(rows)))


def print_grid(title: str, header: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str] = ()) -> None:
    """Print lines of texts under a title and a header, with notes below."""
    grid = _grid()
    for text in header:
        grid.add_column(_plain(text))
    for row in rows:
        grid.add_row(*map(_plain, row))
    _print(_group(title, grid, notes))


def terminal_table(table: Table, *, plain: bool = False) -> "Group":
    """Return title, table and footnotes for a rich console; repeated row headers are said once, trouble is red.

    Where nothing can be bold (``plain``), the best stand between two stars each, as in Markdown.
    """
    grid = _grid()
    for k, header in enumerate(table.header):
        grid.add_column(_plain(header), no_wrap=k < len(table.row_keys))
    for values, cells in zip(table.sparse_rows, table.cells, strict=True):
        grid.add_row(*map(_plain, values), *(_text(cell, plain=plain) for cell in cells))
    return _group(table.title, grid, table.footnotes)


def _grid() -> "RichTable":
    from rich import box
    from rich.table import Table as RichTable

    return RichTable(box=box.SIMPLE_HEAD, pad_edge=False)


def _group(title: str, grid: "RichTable", notes: Sequence[str]) -> "Group":
    from rich.console import Group

    return Group(_plain(title, "bold"), grid, *map(_plain, notes))


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
    return [f"{what} {k} {status}: {reason}" for what, k, status, reason in zip(*columns, strict=True)]


def _plain(text: str, style: str = "") -> "Text":
    from rich.text import Text

    return Text(plain(text), style=style)


def _text(cell: TableCell | None, *, plain: bool = False) -> "Text":
    from rich.text import Text

    if cell is None:
        return Text(ABSENT, style="dim")
    marked = cell.text.replace(cell.number, f"**{cell.number}**", 1) if plain and cell.best else cell.text
    text = Text(marked)
    if cell.best and not plain:
        text.stylize("bold", 0, len(cell.number))
    if cell.trouble:
        text.stylize("red", len(marked) - len(cell.trouble))
    return text
