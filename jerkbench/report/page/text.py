"""Small pieces of HTML."""

from collections.abc import Iterable, Sequence
from html import escape


def bullets(lines: Iterable[str]) -> str:
    """Return a list of sentences."""
    return f"<ul>{''.join(f'<li>{escape(line)}</li>' for line in lines)}</ul>"


def fold(summary: str, content: str, *, opened: bool = False) -> str:
    """Return ``content`` behind a line that opens it."""
    return f"<details{' open' if opened else ''}><summary>{escape(summary)}</summary>{content}</details>"


def grid(heads: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """Return a table; the cells of ``lines`` are HTML already."""
    head = "".join(f'<th scope="col">{escape(text)}</th>' for text in heads)
    body = "".join(f"<tr>{''.join(f'<td>{cell}</td>' for cell in line)}</tr>" for line in lines)
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def small(text: str) -> str:
    """Return ``text`` as a side remark."""
    return f'<span class="interval">{escape(text)}</span>'
