r"""Table -> LaTeX (booktabs); needs ``\usepackage{booktabs}`` and nothing else."""

from itertools import zip_longest

from jerkbench.report.table import ABSENT, Cell, Table

SPECIAL = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "[": "{[}",  # after a line break LaTeX would take a bracket for its argument
    "]": "{]}",
    "_": r"\_",
    "%": r"\%",
    "&": r"\&",
    "#": r"\#",
    "$": r"\$",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    "–": "--",  # noqa: RUF001 - what the key is for
    "µ": r"$\mu$",
    "±": r"$\pm$",
    "σ": r"$\sigma$",  # noqa: RUF001 - what the key is for
}
"""Characters that LaTeX reads otherwise, and how to write them."""


def latex(table: Table) -> str:
    """Return a ``table`` environment: the title as caption, booktabs rules, the footnotes under it."""
    lines = [
        r"\begin{table}",
        r"  \centering",
        rf"  \caption{{{escaped(table.title)}}}",
        rf"  \label{{tab:{table.metric.replace('_', '-')}}}",
        r"  \small",
        rf"  \begin{{tabular}}{{{'l' * len(table.header)}}}",
        r"    \toprule",
        _line([escaped(text) for text in table.header]),
        r"    \midrule",
        *_body(table),
        r"    \bottomrule",
        r"  \end{tabular}",
        *_notes(table),
        r"\end{table}",
    ]
    return "\n".join([*lines, ""])


def escaped(text: str) -> str:
    r"""Write ``text`` so that LaTeX prints it as it is.

    >>> escaped("sage_husa")
    'sage\\_husa'
    """
    return "".join(SPECIAL.get(character, character) for character in " ".join(text.split()))


def _body(table: Table) -> list[str]:
    """Return the lines; the numbers of a row on the first, their intervals and troubles below them."""
    lines = []
    for values, cells in zip(table.sparse_rows, table.cells, strict=True):
        columns = [*([escaped(value)] for value in values), *(_stack(cell) for cell in cells)]
        lines += [_line(list(texts)) for texts in zip_longest(*columns, fillvalue="")]
    return lines


def _line(texts: list[str]) -> str:
    return "    " + " & ".join(texts) + r" \\"


def _stack(cell: Cell | None) -> list[str]:
    if cell is None:
        return [escaped(ABSENT)]
    number = rf"\textbf{{{cell.number}}}" if cell.best else escaped(cell.number)
    small = [rf"{{\scriptsize {escaped(text)}}}" for text in (cell.interval, cell.trouble) if text]
    return [number, *small] if number else small


def _notes(table: Table) -> list[str]:
    if not table.footnotes:
        return []
    notes = [rf"    {escaped(note)}\par" for note in table.footnotes]
    return [
        r"",
        r"  \smallskip",
        r"  \begin{minipage}{\linewidth}\footnotesize\raggedright",
        *notes,
        r"  \end{minipage}",
    ]
