"""Table -> Markdown that also reads well in a terminal."""

from jerkbench.report.tables.table_model import ABSENT, Cell, Table


def markdown(table: Table, level: int = 2) -> str:
    """Return the table as a section with a heading of ``level``, aligned pipes and its footnotes as a list."""
    lines = [[_escaped(text) for text in table.header]]
    for values, cells in zip(table.rows, table.cells, strict=True):
        lines.append([*(_escaped(value) for value in values), *(_text(cell) for cell in cells)])
    widths = [max(3, *(len(line[k]) for line in lines)) for k in range(len(lines[0]))]
    rule = "|" + "|".join("-" * (width + 2) for width in widths) + "|"
    head, *body = [_line(line, widths) for line in lines]
    notes = [f"- {_escaped(note)}" for note in table.footnotes]
    return "\n".join(["#" * level + f" {table.title}", "", head, rule, *body, *([""] if notes else []), *notes, ""])


def _line(texts: list[str], widths: list[int]) -> str:
    return "| " + " | ".join(text.ljust(width) for text, width in zip(texts, widths, strict=True)) + " |"


def _text(cell: Cell | None) -> str:
    if cell is None:
        return ABSENT
    return cell.text.replace(cell.number, f"**{cell.number}**", 1) if cell.best else cell.text


def _escaped(text: str) -> str:
    """Keep a text in its cell: a pipe would end it, a line break the row."""
    return " ".join(text.split()).replace("|", "\\|")
