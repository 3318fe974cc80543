r"""Table -> LaTeX that fits the width of A4 paper: headings in the place of the first factors, columns in blocks."""

from collections.abc import Sequence

from jerkbench.report.tables.latex import (
    SETUP,
    column_type,
    escaped,
    line_of,
    notes_below,
    packages_line,
    stack,
    titled,
)
from jerkbench.report.tables.narrow_layout import groups, parted
from jerkbench.report.tables.table_model import Table, TableCell

TEXT_PT = 455.0
"""Width of the text on A4 with margins of 25 mm."""

SEPARATION_PT = 3.0
"""Room on either side of a column."""

NUMBER_PT, SMALL_PT = 4.25, 4.0
"""Width of a digit in footnotesize, and of one in scriptsize: Computer Modern, its widest of the usual fonts."""

THIN, THIN_PART = frozenset(".,;:[](){}|!'ijlt "), 0.62
"""Characters that take less, and how much of a digit's width."""

WIDE, WIDE_PART = frozenset("mwMW_+="), 1.6
"""Characters that take more."""

PACKAGES = ("booktabs", "siunitx", "longtable")
PAPER = r"\usepackage[a4paper,margin=25mm]{geometry}"


def fitted_latex(table: Table) -> str:
    """Return ``longtable`` environments that are no wider than A4 with margins of 25 mm.

    Numbers stand in footnotesize, intervals below them in scriptsize. All row factors but the last become headings, and
    columns that do not fit beside each other come in a table of their own. Widths are those of Computer Modern.
    """
    keys = [row[-1:] for row in table.rows]
    first = max((_width_pt(text, NUMBER_PT) for key in [table.row_keys[-1:], *keys] for text in key), default=0.0)
    widths = [_column_pt(table, k) for k in range(len(table.columns))]
    room = TEXT_PT - (first + 2 * SEPARATION_PT if table.row_keys else 0.0)
    blocks = [list(part) for part in parted(widths, room, 2 * SEPARATION_PT)]
    tables = [line for place, block in enumerate(blocks) for line in _environment(table, block, place)]
    return "\n".join([f"{packages_line(PACKAGES)} {PAPER}", *tables, *notes_below(table), ""])


def _environment(table: Table, block: Sequence[int], place: int) -> list[str]:
    """The columns of ``block``, continued from the table before."""
    keys = len(table.row_keys)
    types = "".join(column_type([row[k] for row in table.cells]) for k in block)
    names = [escaped(key) for key in table.row_keys[-1:]] + [f"{{{escaped(table.header[keys + k])}}}" for k in block]
    label = rf"\label{{tab:{table.metric.replace('_', '-')}}}" if place == 0 else ""
    caption = rf"    \caption{'*' if place else ''}{{{titled(table)}{', continued' * (place > 0)}}}{label}\\"
    ruled = [r"    \toprule", line_of(names), r"    \midrule"]
    return [
        r"{",
        rf"  \footnotesize{SETUP}\setlength{{\tabcolsep}}{{{SEPARATION_PT:g}pt}}",
        rf"  \begin{{longtable}}{{{'l' * (keys > 0)}{types}}}",
        caption,
        *ruled,
        r"    \endfirsthead",
        *ruled,
        r"    \endhead",
        r"    \bottomrule",
        r"    \endfoot",
        *_body(table, block),
        r"  \end{longtable}",
        r"}",
    ]


def _body(table: Table, block: Sequence[int]) -> list[str]:
    """The lines of each heading; those of a row, and a heading with its first row, stay on one page."""
    width = len(block) + (len(table.row_keys) > 0)
    lines = []
    for heading, rows in groups(table):
        if heading:
            lines.append(rf"    \multicolumn{{{width}}}{{l}}{{\itshape {escaped(heading)}}} \\*")
        for row in rows:
            cells = [_stack(table.cells[row][k]) for k in block]
            texts = [[escaped(text)] for text in table.rows[row][-1:]] + cells
            height = max(map(len, texts))
            row_lines = [line_of([column[k] if k < len(column) else "" for column in texts]) for k in range(height)]
            lines += [*(f"{line}*" for line in row_lines[:-1]), row_lines[-1]]
    return lines


def _stack(cell: TableCell | None) -> list[str]:
    """The lines of a cell, words about lost runs in several."""
    if cell is None or not cell.trouble:
        return stack(cell)
    without = stack(cell)[:-1]
    return without + [rf"{{{{\scriptsize {escaped(part)}}}}}" for part in _parts(cell.trouble)]


def _parts(trouble: str) -> list[str]:
    """Break after what separates the words about lost runs."""
    return [part.strip() for part in trouble.replace("; ", ";\n").replace(", ", ",\n").split("\n")]


def _column_pt(table: Table, column: int) -> float:
    cells = [row[column] for row in table.cells if row[column] is not None]
    numbers = [_width_pt(cell.number, NUMBER_PT) * (1.15 if cell.best else 1.0) for cell in cells if cell]
    small = [part for cell in cells if cell for part in (cell.interval, cell.factor, *_parts(cell.trouble))]
    header = _width_pt(table.header[len(table.row_keys) + column], NUMBER_PT)
    return max([header, *numbers, *(_width_pt(part, SMALL_PT) for part in small)])


def _width_pt(text: str, digit_pt: float) -> float:
    parts = (THIN_PART if letter in THIN else WIDE_PART if letter in WIDE else 1.0 for letter in text)
    return digit_pt * sum(parts)
