"""Table -> HTML."""

from collections.abc import Iterator
from dataclasses import dataclass

from jerkbench.report.markup import render
from jerkbench.report.tables.table_model import ABSENT, Table, TableCell


@dataclass(frozen=True)
class Head:
    """One value of a row's factors.

    Attributes:
        text: the value.
        same: whether the row above has it too, and all before it.
    """

    text: str
    same: bool


@dataclass(frozen=True)
class Line:
    """One row.

    Attributes:
        heads: its factors.
        cells: its cells.
        rule: "group" where the first of several factors changes, "part" where another but the last does, or nothing.
    """

    heads: tuple[Head, ...]
    cells: tuple[TableCell | None, ...]
    rule: str


def html_table(table: Table, level: int = 2) -> str:
    """Return a ``section`` with a heading, a ``table`` whose best cells are ``strong``, and its footnotes as a list.

    What a row repeats of the one above it has the class "same"; where a group of rows begins its row says so.
    """
    return render("table.html", table=table, lines=list(_lines(table)), level=level, absent=ABSENT)


def _lines(table: Table) -> Iterator[Line]:
    for values, before, cells in zip(table.rows, [(), *table.rows], table.cells, strict=False):
        same = [values[: k + 1] == before[: k + 1] for k in range(len(values))]
        yield Line(tuple(map(Head, values, same)), cells, _rule(same) if before else "")


def _rule(same: list[bool]) -> str:
    if all(same[:-1]):
        return ""
    return "part" if same[0] else "group"
