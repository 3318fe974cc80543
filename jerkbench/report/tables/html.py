"""Table -> HTML."""

from html import escape

from jerkbench.report.tables.table_model import ABSENT, Cell, Table


def html_table(table: Table, level: int = 2) -> str:
    """Return a ``section`` with a heading, a ``table`` whose best cells are ``strong``, and its footnotes as a list.

    What a row repeats of the one above it has the class "same".
    """
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in table.header)
    body = "\n".join(
        f"<tr>{_heads(values, before)}{''.join(map(_cell, cells))}</tr>"
        for values, before, cells in zip(table.rows, [(), *table.rows], table.cells, strict=False)
    )
    notes = "\n".join(f"<li>{escape(note)}</li>" for note in table.footnotes)
    return (
        f"<section>\n<h{level}>{escape(table.title)}</h{level}>\n<table>\n<thead><tr>{head}</tr></thead>\n"
        f"<tbody>\n{body}\n</tbody>\n</table>\n<ul>\n{notes}\n</ul>\n</section>\n"
    )


def _heads(values: tuple[str, ...], before: tuple[str, ...]) -> str:
    same = [values[: k + 1] == before[: k + 1] for k in range(len(values))]
    marks = [' class="same"' if one else "" for one in same]
    return "".join(f'<th scope="row"{mark}>{escape(value)}</th>' for value, mark in zip(values, marks, strict=True))


def _cell(cell: Cell | None) -> str:
    if cell is None:
        return f"<td>{ABSENT}</td>"
    number = f"<strong>{escape(cell.number)}</strong>" if cell.best else escape(cell.number)
    small = (("factor", cell.factor), ("interval", cell.interval), ("trouble", cell.trouble))
    rest = [f'<span class="{name}">{escape(text)}</span>' for name, text in small if text]
    return f"<td>{' '.join([number, *rest]).strip()}</td>"
