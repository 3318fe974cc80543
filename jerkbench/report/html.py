"""Table -> HTML."""

from html import escape

from jerkbench.report.table import ABSENT, Cell, Table


def html_table(table: Table) -> str:
    """Return a ``section`` with a heading, a ``table`` whose best cells are ``strong``, and its footnotes as a list."""
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in table.header)
    body = "\n".join(
        f"<tr>{_heads(values)}{''.join(map(_cell, cells))}</tr>"
        for values, cells in zip(table.rows, table.cells, strict=True)
    )
    notes = "\n".join(f"<li>{escape(note)}</li>" for note in table.footnotes)
    return (
        f"<section>\n<h2>{escape(table.title)}</h2>\n<table>\n<thead><tr>{head}</tr></thead>\n"
        f"<tbody>\n{body}\n</tbody>\n</table>\n<ul>\n{notes}\n</ul>\n</section>\n"
    )


def _heads(values: tuple[str, ...]) -> str:
    return "".join(f'<th scope="row">{escape(value)}</th>' for value in values)


def _cell(cell: Cell | None) -> str:
    if cell is None:
        return f"<td>{ABSENT}</td>"
    number = f"<strong>{escape(cell.number)}</strong>" if cell.best else escape(cell.number)
    small = (("interval", cell.interval), ("factor", cell.factor), ("trouble", cell.trouble))
    rest = [f'<span class="{name}">{escape(text)}</span>' for name, text in small if text]
    return f"<td>{' '.join([number, *rest]).strip()}</td>"
