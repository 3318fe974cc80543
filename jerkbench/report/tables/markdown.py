"""Table -> Markdown that also reads well in a terminal."""

import re
from collections.abc import Sequence

from jerkbench.report.tables.table_model import ABSENT, Table, TableCell

ACTIVE = re.compile(r"<(?=[A-Za-z/!?])|(?<=!)\[|\[(?=.*\][(\[])|\\(?=[\\|<\[!])")
"""The beginning of a tag, of an image or of a link; a backslash before one of them, or before the end of a cell."""


def markdown(table: Table, level: int = 2) -> str:
    """Return the table as a section with a heading of ``level``, aligned pipes and its footnotes as a list."""
    rows = [
        [*map(_escaped, values), *(_text(cell) for cell in cells)]
        for values, cells in zip(table.rows, table.cells, strict=True)
    ]
    return _section(table.title, [[_escaped(text) for text in table.header], *rows], table.footnotes, level)


def markdown_grid(
    title: str, header: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str] = (), level: int = 2
) -> str:
    """Return rows of texts as such a section."""
    return _section(title, [[_escaped(text) for text in line] for line in (header, *rows)], notes, level)


def passive(text: str) -> str:
    """Return Markdown whose tags, images and links are shown as text."""
    return ACTIVE.sub(r"\\\g<0>", text)


def _section(title: str, lines: Sequence[Sequence[str]], footnotes: Sequence[str], level: int) -> str:
    widths = [max(3, *(len(line[k]) for line in lines)) for k in range(len(lines[0]))]
    rule = "|" + "|".join("-" * (width + 2) for width in widths) + "|"
    head, *body = [_line(line, widths) for line in lines]
    notes = [f"- {_escaped(note)}" for note in footnotes]
    return "\n".join(["#" * level + f" {_escaped(title)}", "", head, rule, *body, *([""] if notes else []), *notes, ""])


def _line(texts: Sequence[str], widths: Sequence[int]) -> str:
    return "| " + " | ".join(text.ljust(width) for text, width in zip(texts, widths, strict=True)) + " |"


def _text(cell: TableCell | None) -> str:
    if cell is None:
        return ABSENT
    return cell.text.replace(cell.number, f"**{cell.number}**", 1) if cell.best else cell.text


def _escaped(text: str) -> str:
    """Keep a text in its cell, as text: a pipe would end it, a line break the row; tags and images would be loaded."""
    return passive(" ".join(text.split())).replace("|", r"\|")
