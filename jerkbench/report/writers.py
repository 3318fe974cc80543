"""A table as text: Markdown, LaTeX (siunitx 3), HTML by templates, JSON, tidy CSV, one line a cell with all digits."""

import csv
import io
import json
import math
import re
from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from hashlib import sha256
from itertools import zip_longest
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from jerkbench.evaluation.intervals import share_interval
from jerkbench.io.text import is_number
from jerkbench.notices import plain
from jerkbench.report.columns import FACTORS
from jerkbench.report.table_model import ABSENT, Table, TableCell, TextPart, parts

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup


ACTIVE = re.compile(r"<(?=[A-Za-z/!?])|(?<=!)\[|\[(?=.*\][(\[])|\\(?=[\\|<\[!])")
"""The beginning of a tag, an image or a link in Markdown; a backslash before one of them, or before a cell's end."""

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

_PAGE = 44
"""As many lines of a table have room on a page, with its caption and some footnotes."""

_PLAIN = re.compile(r"-?[0-9]+(\.[0-9]+)?")
"""Numbers that a column of siunitx can align."""

_UNITS = {"%": r"\percent", "µs": r"\micro\second", "deg": r"\degree"}
"""Units that siunitx takes no letters for."""

VALUES = (
    *("average", "mean", "low", "high", "runs", "diverged", "failed", "missing", "replicate"),
    *("ratio", "ratio_low", "ratio_high", "p", "quartile_low", "quartile_high", "locked_out"),
    *("lost_share_low", "lost_share_high", "geometric_mean"),
)
"""Columns of CSV after the metric, its unit and the factors; the ends are a range where ``replicate`` is "phase";
the ratio is empty without a baseline; ``average`` says what "mean" is: that, a geometric mean or a median; the ends of
the share of lost runs are those of Clopper and Pearson; "geometric_mean" is that of the runs that went well."""

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""What a spreadsheet takes for the beginning of a formula."""

LOST = "lost"
"""In JSON in the place of a number that is larger than every number: the median run was lost."""


def markdown(table: Table, level: int = 2) -> str:
    """Return the table as a section with a heading of ``level``, aligned pipes and its footnotes as a list."""
    rows = [
        [
            *map(_inactive, values),
            *(" ".join(f"**{text}**" if style == "best" else text for text, style in parts(cell)) for cell in cells),
        ]
        for values, cells in zip(table.rows, table.cells, strict=True)
    ]
    return _section(table.title, [[*map(_inactive, table.header)], *rows], table.footnotes, level)


def markdown_grid(
    title: str, header: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str] = (), level: int = 2
) -> str:
    """Return rows of texts as such a section."""
    return _section(title, [[*map(_inactive, line)] for line in (header, *rows)], notes, level)


def plain_table(head: Iterable[object], rows: Iterable[Iterable[object]]) -> str:
    """Return rows of texts that are our own as a Markdown table."""
    lines = [[*map(str, line)] for line in (head, *rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in (lines[0], ["---"] * len(lines[0]), *lines[1:]))


def passive(text: str) -> str:
    """Return Markdown whose tags, images and links are shown as text."""
    return ACTIVE.sub(r"\\\g<0>", text)


def _section(title: str, lines: Sequence[Sequence[str]], footnotes: Sequence[str], level: int) -> str:
    widths = [max(3, *map(len, column)) for column in zip(*lines, strict=True)]
    rule = "|" + "|".join("-" * (width + 2) for width in widths) + "|"
    padded = [[text.ljust(width) for text, width in zip(line, widths, strict=True)] for line in lines]
    head, *body = [f"| {' | '.join(line)} |" for line in padded]
    notes = [f"- {_inactive(note)}" for note in footnotes]
    return "\n".join(["#" * level + f" {_inactive(title)}", "", head, rule, *body, *[""] * bool(notes), *notes, ""])


def _inactive(text: str) -> str:
    """Keep a text in its cell, as text: a pipe would end it, a line break the row; tags and images would be loaded."""
    return passive(" ".join(text.split())).replace("|", r"\|")


def latex(table: Table) -> str:
    """Return a ``table`` environment: the title as caption, booktabs rules, numbers at the point, footnotes below.

    What is too long for a page is a ``longtable`` instead, with its head on every page. The first line is a comment
    that names the packages.
    """
    keys = len(table.row_keys)
    columns = "l" * keys + "".join(map(_column_type, zip(*table.cells, strict=True)))
    heads = [latex_escaped(text) for text in table.header]
    ruled = [r"    \toprule", _line([*heads[:keys], *(f"{{{text}}}" for text in heads[keys:])]), r"    \midrule"]
    caption = rf"\caption{{{_titled(table)}}}\label{{tab:{table.metric.replace('_', '-')}}}"
    body = [line for row in zip(table.sparse_rows, table.cells, strict=True) for line in _lines(*row)]
    notes = [rf"    {latex_escaped(note)}\par" for note in table.footnotes]
    if notes:
        begin = [r"", r"  \smallskip", r"  \noindent\begin{minipage}{\linewidth}\footnotesize\raggedright"]
        notes = [*begin, *notes, r"  \end{minipage}"]
    if len(body) > _PAGE:
        packages = "booktabs,siunitx,longtable"
        start = [r"{", rf"  \small{SETUP}", rf"  \begin{{longtable}}{{{columns}}}", rf"    {caption}\\"]
        head = [*ruled, r"    \endfirsthead", *ruled, r"    \endhead", r"    \bottomrule", r"    \endfoot"]
        inside, end = [*start, *head, *body, r"  \end{longtable}"], "}"
    else:
        packages = "booktabs,siunitx"
        start = [r"\begin{table}", r"  \centering", rf"  {SETUP}", f"  {caption}", r"  \small"]
        head = [rf"  \begin{{tabular}}{{{columns}}}", *ruled]
        inside, end = [*start, *head, *body, r"    \bottomrule", r"  \end{tabular}"], r"\end{table}"
    return "\n".join([rf"% \usepackage{{{packages}}}", *inside, *notes, end, ""])


def latex_escaped(text: str) -> str:
    r"""Write ``text`` so that LaTeX prints it as it is.

    >>> latex_escaped("sage_husa")
    'sage\\_husa'
    """
    return "".join(SPECIAL.get(character, character) for character in plain(" ".join(text.split())))


def _lines(values: Sequence[str], cells: Sequence[TableCell | None]) -> list[str]:
    """Return the lines of a row: its numbers on the first, their intervals and troubles below them, on one page."""
    columns = [*([latex_escaped(value)] for value in values), *([*map(_small, parts(cell))] for cell in cells)]
    lines = [_line(texts) for texts in zip_longest(*columns, fillvalue="")]
    return [*(f"{line}*" for line in lines[:-1]), lines[-1]]


def _line(texts: Sequence[str]) -> str:
    return "    " + " & ".join(texts) + r" \\"


def _small(part: TextPart) -> str:
    """Write a part of a cell; what is no plain number stands in braces, so that siunitx leaves it alone."""
    text, style = part
    if style not in ("best", "number", "absent"):
        return rf"{{{{\scriptsize {latex_escaped(text)}}}}}"
    number = text if _PLAIN.fullmatch(text) else f"{{{latex_escaped(text)}}}"
    return rf"\bfseries {number}" if style == "best" else number


def _column_type(cells: Sequence[TableCell | None]) -> str:
    """Return a column of siunitx with room for the digits of its plain numbers; a centred one where it has none."""
    numbers = [cell.number for cell in cells if cell is not None and _PLAIN.fullmatch(cell.number)]
    if not numbers:
        return "c"
    whole, decimals = (max(len(text.partition(".")[k]) for text in numbers) for k in (0, 2))
    return f"S[table-format={whole}.{decimals}]"


def _titled(table: Table) -> str:
    """Return the title, the unit in brackets as siunitx writes it."""
    unit = f" [{table.unit}]"
    if not table.unit or not table.title.endswith(unit):
        return latex_escaped(table.title)
    return rf"{latex_escaped(table.title.removesuffix(unit))} {{[}}\unit{{{_UNITS.get(table.unit, table.unit)}}}{{]}}"


def html_table(table: Table, level: int = 2) -> str:
    """Return a ``section`` with a heading, a ``table`` whose best cells are ``strong``, and its footnotes as a list.

    What a row repeats of the one above it has the class "same"; where a group of rows begins its row has the class
    "group", where another factor but the last changes "part".
    """
    lines = []
    for values, before, cells in zip(table.rows, [(), *table.rows], table.cells, strict=False):
        same = [values[: k + 1] == before[: k + 1] for k in range(len(values))]
        rule = "" if not before or all(same[:-1]) else "part" if same[0] else "group"
        lines.append({"heads": list(zip(values, same, strict=True)), "cells": cells, "rule": rule})
    return render("table.html", table=table, lines=lines, level=level, absent=ABSENT)


def table_json(table: Table) -> str:
    """Return the table as JSON; what is no number is null, a median that is a lost run "lost"."""
    content = {
        **{name: getattr(table, name) for name in ("title", "metric", "unit", "row_keys", "column_keys")},
        "baseline": dict(table.baseline),
        "cells": [{"combination": labels, **_json_values(cell)} for labels, cell in table.placed()],
        "footnotes": table.footnotes,
    }
    return json.dumps(content, indent=2, allow_nan=False) + "\n"


def _json_values(cell: TableCell) -> dict[str, Any]:
    ratio = cell.ratio and {
        **dict(zip(("value", "low", "high", "p"), map(_json_number, _ratio_numbers(cell)), strict=True)),
        "different": cell.ratio.mark == "*",
        "equal": cell.ratio.mark == "=",
    }
    return {
        "average": cell.kind,
        **{name: _json_number(getattr(cell, name)) for name in ("mean", "low", "high")},
        "geometric_mean": _json_number(cell.geometric),
        "quartiles": [_json_number(value) for value in cell.quartiles],
        **{name: int(getattr(cell, name)) for name in ("runs", "diverged", "failed", "missing", "locked")},
        "replicate": cell.replicate,
        "best": bool(cell.best),
        "ratio": ratio,
    }


def _ratio_numbers(cell: TableCell) -> tuple[float, ...]:
    """Return the ratio to the baseline, the ends of its interval and its p; nothing without one."""
    if cell.ratio is None:
        return ()
    judgement = cell.ratio.judgement
    return judgement.ratio, judgement.low, judgement.high, judgement.p


def _json_number(value: float) -> float | str | None:
    if value == math.inf:
        return LOST
    return float(value) if math.isfinite(value) else None


def tidy_csv(tables: Sequence[Table]) -> str:
    """Return a header and one line for each cell of the tables; a number that is not there is empty."""
    each = ((table, (cell for line in table.cells for cell in line if cell is not None)) for table in tables)
    lines = (line for table, cells in each for line in csv_lines(table.metric, table.unit, cells, csv_labels(table)))
    return ",".join(["metric", "unit", *FACTORS, *VALUES]) + "\n" + "".join(lines)


def csv_labels(table: Table) -> list[str]:
    """Return the factors of each cell as they stand in its line; they are the same for every metric of a study."""
    return [",".join(csv_escaped(labels[factor]) for factor in FACTORS) for labels, _ in table.placed()]


def csv_lines(metric: str, unit: str, cells: Iterable[TableCell], labels: Sequence[str]) -> Iterator[str]:
    """Yield a line for each of ``cells``, in the order of a table: metric, unit, its ``labels``, and its numbers."""
    head = f"{csv_escaped(metric)},{csv_escaped(unit)}"
    for factors, cell in zip(labels, cells, strict=True):
        mean, low, high, runs, diverged, failed, missing, replicate, kind, locked, quartiles, geometric = cell[:12]
        centre = f"{mean!r},{low!r},{high!r},{runs},{diverged},{failed},{missing}".replace("nan", "")
        ratio = ",".join(map(csv_number, _ratio_numbers(cell))) or ",,,"
        spread = f"{quartiles[0]!r},{quartiles[1]!r},{locked},{_csv_shares(diverged + failed, runs)},{geometric!r}\n"
        yield f"{head},{factors},{kind},{centre},{replicate},{ratio},{spread.replace('nan', '')}"


@cache
def _csv_shares(lost: int, runs: int) -> str:
    return ",".join(map(csv_number, share_interval(lost, runs)))


def csv_number(value: float) -> str:
    """Return all digits of a number; nothing of what is none."""
    return "" if math.isnan(value) else repr(float(value))


@cache
def csv_escaped(text: str) -> str:
    """Return a text as it stands in a line of CSV, which a spreadsheet takes for text."""
    line = io.StringIO()
    csv.writer(line, lineterminator="\n").writerow([plain(inert(text)), ""])
    return line.getvalue()[:-2]


def write_rows_csv(rows: pd.DataFrame, path: Path) -> None:
    """Write rows as CSV. Missing values are empty, and no text is a formula or steers a terminal."""

    def neutral(value: Any) -> Any:  # noqa: ANN401 - a text, or what stands for none
        return plain(inert(value)) if isinstance(value, str) else value

    texts = {str(name): rows[name] for name in rows if not pd.api.types.is_numeric_dtype(rows[name])}
    written = {name: own.map({value: neutral(value) for value in own.unique()}) for name, own in texts.items()}
    rows.assign(**written).rename(columns=neutral).to_csv(path, index=False, lineterminator="\n")


def inert(text: str) -> str:
    """Return a text that a spreadsheet takes for text: an apostrophe stands before what would be a formula.

    >>> inert("=1+1")
    "'=1+1"
    """
    return f"'{text}" if text.startswith(FORMULA) and len(text) > 1 and not is_number(text) else text


WRITERS: Mapping[str, Callable[[Table], str]] = {
    "md": markdown,
    "csv": lambda table: tidy_csv([table]),
    "tex": latex,
    "html": html_table,
    "json": table_json,
}
"""By the name of a format."""


# Templates -> HTML, with everything that a template prints escaped.


BREAKS = re.compile(r"(?<=\S[_+,(=])(?=\w)")
"""Where a long name may be broken."""


def render(template: str, **values: object) -> "Markup":
    """Return a template filled in; as safe HTML, which another template does not escape again.

    Args:
        template: name of its file.
        values: what it names; one that is not given is an error.
    """
    from markupsafe import Markup

    return Markup(environment().get_template(template).render(**values))  # noqa: S704 - the template escapes


@cache
def environment() -> "Environment":
    """Return where templates are found, and what they can call."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    templates = Environment(
        loader=PackageLoader("jerkbench.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    templates.filters["breakable"] = breakable
    templates.globals["policy"] = policy
    return templates


def policy(scripts: Sequence[str]) -> str:
    """Return the Content-Security-Policy of a page that runs ``scripts`` alone, and loads nothing from elsewhere."""
    digests = " ".join(f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'" for text in scripts)
    return (
        f"default-src 'none'; script-src {digests}; style-src 'unsafe-inline'; img-src data:; base-uri 'none';"
        " form-action 'none'"
    )


def breakable(text: object) -> "Markup":
    """Return ``text`` escaped, with the places marked at which a long name may go on in the next line."""
    from markupsafe import Markup, escape

    return Markup("<wbr>").join(escape(part) for part in BREAKS.split(str(text)))
