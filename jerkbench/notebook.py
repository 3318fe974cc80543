"""The HTML that a notebook shows of an object: a title and a table of names and values."""

from collections.abc import Mapping
from html import escape

from jerkbench.arrays import FloatArray


def shown(title: str, values: Mapping[str, str]) -> str:
    """Return a title above a table with a line for each value."""
    lines = (f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in values.items())
    return f"<section><h4>{escape(title)}</h4><table>{''.join(lines)}</table></section>"


def stamps_text(t_s: FloatArray) -> str:
    """Say how many stamps there are, and from when to when."""
    if len(t_s) == 0:
        return "none"
    rate = f", {(len(t_s) - 1) / (t_s[-1] - t_s[0]):.3g} Hz" if len(t_s) > 1 else ""
    return f"{len(t_s)} from {t_s[0]:.2f} to {t_s[-1]:.2f} s{rate}"
