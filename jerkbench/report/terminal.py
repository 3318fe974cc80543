"""Print tables in a terminal of any width. Numbers and intervals are never broken over two lines."""

import dataclasses
import sys
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from jerkbench.notices import plain, styled
from jerkbench.report.columns import FACTORS, metric_columns, quantity
from jerkbench.report.summary import main_metric, summarise
from jerkbench.report.table_model import Table, TableCell, arranged, parts

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import Console, Group
    from rich.table import Table as RichTable
    from rich.text import Text


MAX_ROWS = 500
"""Maximum number of rows that a sweep prints at its end."""

_STYLES = {"best": "bold", "trouble": "red", "absent": "dim"}
"""Rich style of each kind of text in a cell. Kinds of text that are not listed have no style."""


def print_table(rows: "pd.DataFrame", notes: Sequence[str] = (), metric: str | None = None) -> None:
    """Print the table of ``metric`` (default: `main_metric`) with ``notes``, at full width if the output is a pipe."""
    print_beginning(summarise(rows, metric or main_metric(rows), notes=notes))


def print_beginning(table: Table) -> None:
    """Print at most the first `MAX_ROWS` rows of a table."""
    if len(table.rows) > MAX_ROWS:
        left_out = f"These are the first {MAX_ROWS} of {len(table.rows)} rows; table.md has all."
        first = table.rows[:MAX_ROWS], table.cells[:MAX_ROWS]
        table = dataclasses.replace(table, rows=first[0], cells=first[1], footnotes=(left_out, *table.footnotes))
    print_summary(table)


def print_summary(table: Table) -> None:
    """Print all rows of a table. If the output is a pipe, each cell is printed on one line."""
    console = _console()
    _print(terminal_table(table, console.width if console.is_terminal else None))


def print_run(rows: "pd.DataFrame") -> None:
    """Print all applicable metrics of one combination, and the reasons of its diverged and failed runs."""
    grid = _grid(["metric", f"{len(rows)} {'run' if len(rows) == 1 else 'runs'}"])
    numbers = arranged(rows, FACTORS[:-1], FACTORS[-1:])
    for metric in metric_columns(rows):
        (cell,) = numbers.cells(metric).values()
        if cell.number != "n/a":
            grid.add_row(_plain(quantity(metric).heading), _text(cell))
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
        yield _plain(", ".join(values), "italic")
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
