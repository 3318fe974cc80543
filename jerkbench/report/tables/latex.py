r"""Table -> LaTeX; its first line says which packages it needs (siunitx 3)."""

import re
from collections.abc import Sequence
from itertools import zip_longest

from jerkbench.plain import plain
from jerkbench.report.tables.table_model import ABSENT, Table, TableCell

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
    "×": r"$\times$",  # noqa: RUF001 - what the key is for
    "σ": r"$\sigma$",  # noqa: RUF001 - what the key is for
}
"""Characters that LaTeX reads otherwise, and how to write them."""

SETUP = r"\sisetup{detect-weight=true, mode=text}"

PAGE = 44
"""As many lines of a table have room on a page, with its caption and some footnotes."""

PLAIN = re.compile(r"-?[0-9]+(\.[0-9]+)?")
"""Numbers that a column of siunitx can align."""

UNITS = {"%": r"\percent", "µs": r"\micro\second", "deg": r"\degree"}
"""Units that siunitx takes no letters for."""


def latex(table: Table) -> str:
    """Return a ``table`` environment: the title as caption, booktabs rules, numbers at the point, footnotes below.

    What is too long for a page is a ``longtable`` instead, with its head on every page. The first line is a comment
    that names the packages.
    """
    columns = "".join(column_type([row[k] for row in table.cells]) for k in range(len(table.columns)))
    keys = len(table.row_keys)
    head = line_of([escaped(text) if k < keys else f"{{{escaped(text)}}}" for k, text in enumerate(table.header)])
    caption = rf"\caption{{{titled(table)}}}\label{{tab:{table.metric.replace('_', '-')}}}"
    body = _body(table)
    wrap = _on_pages if len(body) > PAGE else _floating
    packages = packages_line(("booktabs", "siunitx", *["longtable"] * (wrap is _on_pages)))
    return "\n".join([packages, *wrap(caption, "l" * keys + columns, head, body, notes_below(table)), ""])


def packages_line(names: Sequence[str]) -> str:
    """Return the comment that says what belongs into the preamble."""
    return rf"% \usepackage{{{','.join(names)}}}"


def _floating(caption: str, columns: str, head: str, body: list[str], notes: list[str]) -> list[str]:
    return [
        r"\begin{table}",
        r"  \centering",
        rf"  {SETUP}",
        f"  {caption}",
        r"  \small",
        rf"  \begin{{tabular}}{{{columns}}}",
        r"    \toprule",
        head,
        r"    \midrule",
        *body,
        r"    \bottomrule",
        r"  \end{tabular}",
        *notes,
        r"\end{table}",
    ]


def _on_pages(caption: str, columns: str, head: str, body: list[str], notes: list[str]) -> list[str]:
    ruled = [r"    \toprule", head, r"    \midrule"]
    return [
        r"{",
        rf"  \small{SETUP}",
        rf"  \begin{{longtable}}{{{columns}}}",
        rf"    {caption}\\",
        *ruled,
        r"    \endfirsthead",
        *ruled,
        r"    \endhead",
        r"    \bottomrule",
        r"    \endfoot",
        *body,
        r"  \end{longtable}",
        *notes,
        r"}",
    ]


def escaped(text: str) -> str:
    r"""Write ``text`` so that LaTeX prints it as it is.

    >>> escaped("sage_husa")
    'sage\\_husa'
    """
    return "".join(SPECIAL.get(character, character) for character in plain(" ".join(text.split())))


def _body(table: Table) -> list[str]:
    """Return the lines; the numbers of a row on the first, their intervals and troubles below them, on one page."""
    lines = []
    for values, cells in zip(table.sparse_rows, table.cells, strict=True):
        columns = [*([escaped(value)] for value in values), *(stack(cell) for cell in cells)]
        row = [line_of(list(texts)) for texts in zip_longest(*columns, fillvalue="")]
        lines += [*(f"{line}*" for line in row[:-1]), row[-1]]
    return lines


def line_of(texts: list[str]) -> str:
    """Return a line of a table."""
    return "    " + " & ".join(texts) + r" \\"


def stack(cell: TableCell | None) -> list[str]:
    """The lines of a cell; what is no plain number stands in braces, so that siunitx leaves it alone."""
    if cell is None:
        return [f"{{{escaped(ABSENT)}}}"]
    number = cell.number if PLAIN.fullmatch(cell.number) else f"{{{escaped(cell.number)}}}"
    if cell.best:
        number = rf"\bfseries {number}"
    small = (cell.interval, cell.factor, cell.trouble)
    lines = [rf"{{{{\scriptsize {escaped(text)}}}}}" for text in small if text]
    return [number, *lines] if cell.number else lines


def column_type(cells: Sequence[TableCell | None]) -> str:
    """A column of siunitx with room for the digits of its plain numbers; a centred one where it has none."""
    plain = [cell.number for cell in cells if cell is not None and PLAIN.fullmatch(cell.number)]
    if not plain:
        return "c"
    whole, decimals = (max(len(text.partition(".")[k]) for text in plain) for k in (0, 2))
    return f"S[table-format={whole}.{decimals}]"


def titled(table: Table) -> str:
    """The title, the unit in brackets as siunitx writes it."""
    unit = f" [{table.unit}]"
    if not table.unit or not table.title.endswith(unit):
        return escaped(table.title)
    return rf"{escaped(table.title.removesuffix(unit))} {{[}}\unit{{{UNITS.get(table.unit, table.unit)}}}{{]}}"


def notes_below(table: Table) -> list[str]:
    """Return the footnotes, in small print as wide as the text."""
    if not table.footnotes:
        return []
    notes = [rf"    {escaped(note)}\par" for note in table.footnotes]
    return [
        r"",
        r"  \smallskip",
        r"  \noindent\begin{minipage}{\linewidth}\footnotesize\raggedright",
        *notes,
        r"  \end{minipage}",
    ]
