"""Writers of tables (Markdown, LaTeX with siunitx 3, HTML, JSON, tidy CSV), files of a single run, and BibTeX.

The BibTeX entries of the methods and data sets of a study are parsed from the docstrings of the plugins.
"""

import csv
import inspect
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
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np
import pandas as pd

from jerkbench import plugins
from jerkbench.arrays import BoolArray
from jerkbench.errors import JerkbenchError, plain
from jerkbench.estimate import Estimate
from jerkbench.evaluation.counted_rows import known
from jerkbench.evaluation.intervals import share_interval
from jerkbench.files import write_text
from jerkbench.io.files import is_number
from jerkbench.recording import Recording
from jerkbench.report.columns import FACTORS
from jerkbench.report.table_model import ABSENT, Table, TableCell, TextPart, parts

if TYPE_CHECKING:
    from jinja2 import Environment
    from markupsafe import Markup


ACTIVE = re.compile(r"<(?=[A-Za-z/!?])|(?<=!)\[|\[(?=.*\][(\[])|\\(?=[\\|<\[!])")
"""Matches the start of a tag, image or link in Markdown, and a backslash before such a start or before a pipe."""

SPECIAL = {
    "\\": r"\textbackslash{}",
    "{": r"\{",
    "}": r"\}",
    "[": "{[}",  # LaTeX would parse a bracket after a line break as an argument
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
    "–": "--",  # noqa: RUF001 - the key
    "µ": r"$\mu$",
    "±": r"$\pm$",
    "×": r"$\times$",  # noqa: RUF001 - the key
    "σ": r"$\sigma$",  # noqa: RUF001 - the key
}
"""Characters with a special meaning in LaTeX, and their LaTeX code."""

_PLAIN = re.compile(r"-?[0-9]+(\.[0-9]+)?")
"""Matches numbers that siunitx can align in a column."""

VALUES = (
    *("average", "mean", "low", "high", "runs", "diverged", "failed", "missing", "replicate"),
    *("ratio", "ratio_low", "ratio_high", "p", "quartile_low", "quartile_high", "locked_out"),
    *("lost_share_low", "lost_share_high", "geometric_mean"),
)

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""Characters with which a spreadsheet starts a formula."""


def markdown(table: Table, level: int = 2) -> str:
    """Return a Markdown section: a heading of ``level``, the table with aligned columns, and a list of footnotes."""
    rows = [
        [
            *values,
            *(" ".join(f"**{text}**" if style == "best" else text for text, style in parts(cell)) for cell in cells),
        ]
        for values, cells in zip(table.rows, table.cells, strict=True)
    ]
    return markdown_grid(table.title, table.header, rows, table.footnotes, level)


def markdown_grid(
    title: str, header: Sequence[str], rows: Sequence[Sequence[str]], notes: Sequence[str] = (), level: int = 2
) -> str:
    """Return a Markdown section: a heading of ``level``, a table of texts with aligned columns, and a list of notes."""
    lines = [[*map(_inactive, line)] for line in (header, *rows)]
    widths = [max(3, *map(len, column)) for column in zip(*lines, strict=True)]
    rule = "|" + "|".join("-" * (width + 2) for width in widths) + "|"
    padded = [[text.ljust(width) for text, width in zip(line, widths, strict=True)] for line in lines]
    head, *body = [f"| {' | '.join(line)} |" for line in padded]
    listed = [f"- {_inactive(note)}" for note in notes]
    return "\n".join(["#" * level + f" {_inactive(title)}", "", head, rule, *body, *[""] * bool(notes), *listed, ""])


def passive(text: str) -> str:
    """Return Markdown in which HTML tags, images and links are escaped, so that they are displayed as text."""
    return ACTIVE.sub(r"\\\g<0>", text)


def _inactive(text: str) -> str:
    """Escape a text for a Markdown table, in which pipes and line breaks would end a cell."""
    return passive(" ".join(text.split())).replace("|", r"\|")


def latex(table: Table) -> str:
    """Return a LaTeX ``table`` with caption, booktabs rules, aligned numbers and footnotes.

    The first line of the result is a comment that lists the required LaTeX packages.
    """
    keys = len(table.row_keys)
    columns = "l" * keys + "".join(map(_column_type, zip(*table.cells, strict=True)))
    heads = [latex_escaped(text) for text in table.header]
    ruled = [r"    \toprule", _line([*heads[:keys], *(f"{{{text}}}" for text in heads[keys:])]), r"    \midrule"]
    caption = rf"\caption{{{latex_escaped(table.title)}}}\label{{tab:{table.metric.replace('_', '-')}}}"
    body = [line for row in zip(table.sparse_rows, table.cells, strict=True) for line in _lines(*row)]
    notes = [rf"    {latex_escaped(note)}\par" for note in table.footnotes]
    if notes:
        begin = [r"", r"  \smallskip", r"  \noindent\begin{minipage}{\linewidth}\footnotesize\raggedright"]
        notes = [*begin, *notes, r"  \end{minipage}"]
    start = [r"\begin{table}", r"  \centering", r"  \sisetup{detect-weight=true, mode=text}"]
    head = [rf"  \begin{{tabular}}{{{columns}}}", *ruled]
    end = [r"    \bottomrule", r"  \end{tabular}", *notes, r"\end{table}", ""]
    return "\n".join([r"% \usepackage{booktabs,siunitx}", *start, f"  {caption}", r"  \small", *head, *body, *end])


def latex_escaped(text: str) -> str:
    r"""Return ``text`` escaped for LaTeX.

    >>> latex_escaped("sage_husa")
    'sage\\_husa'
    """
    return "".join(SPECIAL.get(character, character) for character in plain(" ".join(text.split())))


def _lines(values: Sequence[str], cells: Sequence[TableCell | None]) -> list[str]:
    """Return the LaTeX lines of a table row: a line with the numbers, then lines with intervals and failures."""
    columns = [*([latex_escaped(value)] for value in values), *([*map(_small, parts(cell))] for cell in cells)]
    lines = [_line(texts) for texts in zip_longest(*columns, fillvalue="")]
    return [*(f"{line}*" for line in lines[:-1]), lines[-1]]


def _line(texts: Sequence[str]) -> str:
    return "    " + " & ".join(texts) + r" \\"


def _small(part: TextPart) -> str:
    """Return a part of a cell as LaTeX. Texts that are not numbers are in braces, so that siunitx ignores the texts."""
    text, style = part
    if style not in ("best", "number", "absent"):
        return rf"{{{{\scriptsize {latex_escaped(text)}}}}}"
    number = text if _PLAIN.fullmatch(text) else f"{{{latex_escaped(text)}}}"
    return rf"\bfseries {number}" if style == "best" else number


def _column_type(cells: Sequence[TableCell | None]) -> str:
    """Return a siunitx column type that fits the digits of the numbers, or "c" (centred) without numbers."""
    numbers = [cell.number for cell in cells if cell is not None and _PLAIN.fullmatch(cell.number)]
    if not numbers:
        return "c"
    integers, decimals = (max(len(text.partition(".")[k]) for text in numbers) for k in (0, 2))
    return f"S[table-format={integers}.{decimals}]"


def html_table(table: Table, level: int = 2) -> str:
    """Return an HTML ``section`` with a heading, a ``table`` (best cells are ``strong``), and a list of footnotes.

    A row label that is equal to the label above it has the class "same". The first row of a group has the class
    "group". A row has the class "part" if the label of any factor except the last factor changes.
    """
    return render("table.html", table=table, level=level, absent=ABSENT)


def table_json(table: Table) -> str:
    """Return the table as JSON. NaN becomes null, and infinity (the median run failed) becomes "lost"."""
    content = {
        **{name: getattr(table, name) for name in ("title", "metric", "unit", "row_keys", "column_keys")},
        "baseline": dict(table.baseline),
        "cells": [
            {"combination": labels, **{name: _json_value(value) for name, value in _values(cell).items()}}
            | {"best": cell.best, "verdict": cell.ratio.verdict.value if cell.ratio else None}
            for labels, cell in table.placed()
        ],
        "footnotes": table.footnotes,
    }
    return json.dumps(content, indent=2, allow_nan=False) + "\n"


def _json_value(value: object) -> object:
    if value == math.inf:
        return "lost"  # the median run failed
    return None if isinstance(value, float) and math.isnan(value) else value


def _values(cell: TableCell) -> dict[str, Any]:
    """Return the numbers of a cell by name, for CSV and JSON."""
    judgement = cell.ratio.judgement if cell.ratio else None
    of_ratio = (judgement.ratio, judgement.low, judgement.high, judgement.p) if judgement else [math.nan] * 4
    values = (
        *(cell.kind, cell.mean, cell.low, cell.high, cell.runs, cell.diverged, cell.failed, cell.missing),
        *(cell.replicate, *of_ratio, *cell.quartiles, cell.locked),
        *(*share_interval(cell.diverged + cell.failed, cell.runs), cell.geometric),
    )
    return dict(zip(VALUES, values, strict=True))


def tidy_csv(tables: Iterable[Table]) -> str:
    """Return a CSV text with a header and one line for each cell of the tables. Unknown numbers become empty fields."""
    text = io.StringIO()
    write_tidy_csv(tables, text)
    return text.getvalue()


def write_tidy_csv(tables: Iterable[Table], file: TextIO) -> None:
    """Write the text of `tidy_csv` to a file, table by table, so that only one table is in memory at a time.

    The column "average" states whether the column "mean" contains a mean, a geometric mean or a median. The columns
    "low" and "high" are the ends of the confidence interval. If "replicate" is "phase", "low" and "high" are the ends
    of the range over phases. The column "ratio" is the ratio to the baseline. Without a baseline, this column is empty.
    The columns "lost_share_low" and "lost_share_high" are the Clopper-Pearson interval of the failure rate. The column
    "geometric_mean" is the geometric mean of the successful runs.
    """
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(["metric", "unit", *FACTORS, *VALUES])
    for table in tables:
        for labels, cell in table.placed():
            texts = map(csv_text, (table.metric, table.unit, *(labels[factor] for factor in FACTORS)))
            values = [*texts, *_values(cell).values()]
            writer.writerow(["" if isinstance(value, float) and math.isnan(value) else value for value in values])


@cache
def csv_text(text: str) -> str:
    """Return ``text`` such that a spreadsheet interprets no formula, and a terminal no control characters."""
    return plain(inert(text))


def write_rows_csv(rows: pd.DataFrame, path: Path) -> None:
    """Write rows as CSV. Missing values are written as empty fields, and texts as returned by `csv_text`."""
    written = {
        str(name): rows[name].map({v: csv_text(v) if isinstance(v, str) else v for v in rows[name].unique()})
        for name in rows
        if not pd.api.types.is_numeric_dtype(rows[name])
    }
    rows.assign(**written).rename(columns=csv_text).to_csv(path, index=False, lineterminator="\n")


def inert(text: str) -> str:
    """Return the text. A text that a spreadsheet would interpret as a formula is returned with an apostrophe before it.

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
"""For each format, the function that returns a table as text in this format."""


# Writers of HTML from templates. The templates escape all values.


BREAKS = re.compile(r"(?<=\S[_+,(=])(?=\w)")
"""Matches the positions at which a long name may be broken into two lines."""


def render(template: str, **values: object) -> "Markup":
    """Return the HTML text of a template with the given values.

    The result is marked as safe, so that a template that contains the result does not escape it again.

    Args:
        template: file name of the template.
        values: values of all variables that the template uses.
    """
    from markupsafe import Markup

    return Markup(environment().get_template(template).render(**values))  # noqa: S704 - the template escapes


@cache
def environment() -> "Environment":
    """Return the Jinja environment with the filters and functions that the templates use."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    templates = Environment(
        loader=PackageLoader("jerkbench.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    templates.filters |= {"breakable": breakable, "zip": zip}
    templates.globals["policy"] = policy
    return templates


def policy(scripts: Sequence[str]) -> str:
    """Return a Content-Security-Policy that allows only the given ``scripts``, and forbids loading other resources."""
    digests = " ".join(f"'sha256-{b64encode(sha256(text.encode()).digest()).decode()}'" for text in scripts)
    return (
        f"default-src 'none'; script-src {digests}; style-src 'unsafe-inline'; img-src data:; base-uri 'none';"
        " form-action 'none'"
    )


def breakable(text: object) -> "Markup":
    """Return ``text`` as escaped HTML with optional line breaks (``<wbr>``) in long names."""
    from markupsafe import Markup, escape

    return Markup("<wbr>").join(escape(part) for part in BREAKS.split(str(text)))


# Files of a single run that other programs read: trajectories in the TUM format.


def write_tum_pair(folder: Path, recording: Recording, estimate: Estimate, counted: BoolArray) -> list[Path]:
    """Write estimate.tum and reference.tum with the rows that metrics count, and return the paths of both files.

    Both files contain positions in ENU at full precision, with the same time stamps. Therefore, the absolute trajectory
    error that other tools compute without alignment equals the metric position_rmse_m. Unknown angles of the reference
    are written as 0.

    Raises:
        JerkbenchError: no counted row has a reference position.
    """
    from scipy.spatial.transform import Rotation

    truth = recording.reference.enu_m
    rows = counted & known(truth, estimate)
    if truth is None or not rows.any():
        raise JerkbenchError(
            f"The recording {recording.name} has no position reference, so there is nothing to export."
        )
    where = estimate.index[rows]
    angles = recording.reference.euler_rad
    euler = np.zeros((len(where), 3)) if angles is None else np.nan_to_num(angles[where])
    t_s = recording.reference.t_s[where]
    trajectories = {
        "reference": (truth[where], euler),
        "estimate": (estimate.position_m[rows], estimate.euler_rad[rows]),
    }
    for name, (position_m, angles_rad) in trajectories.items():
        quaternion = Rotation.from_euler("ZYX", angles_rad[:, ::-1]).as_quat()
        table = pd.DataFrame(np.column_stack([t_s, position_m, quaternion]))
        write_text(folder / f"{name}.tum", table.to_csv(sep=" ", header=False, index=False, lineterminator="\n"))
    return [folder / f"{name}.tum" for name in trajectories]


# The BibTeX entries of the methods and data sets of a study.

DOI = re.compile(r"doi:(10\.\d{4,}/[^\s,;]*[^\s,;.:)])")
"""Matches a DOI in a docstring."""

TITLED = re.compile(r'(?P<author>[^;:(]+?), "(?P<title>[^"]+?),?"[^"]*$')
UNTITLED = re.compile(r"\((?P<author>[^();]+?), \d{4}, $")
YEAR = re.compile(r"\b(?:19|20)\d\d\b(?!-)")

INITIAL = re.compile(r"\b[A-Z]\. ?-?[A-Z]")

PACKAGE_CITATION = "CITATION.cff"


def entries_of(specifications: Iterable[Mapping[str, Any]]) -> list[str]:
    """Return BibTeX entries of jerkbench, and of the papers that describe the plugins of a study."""
    used: dict[type, str] = {}
    for specification in specifications:
        for kind, name in _plugins(specification):
            if name in plugins.names(kind):
                used.setdefault(plugins.get(kind, name), f"{kind} {name}")
    silent = [title for cls, title in used.items() if not (hasattr(cls, "citations") or list(_sources(cls)))]
    lacking = [f"% No source is stated by: {', '.join(silent)}."] if silent else []
    return [package_entry(), *dict.fromkeys(merged(used)), *lacking]


def merged(used: Mapping[type, str]) -> Iterator[str]:
    """Yield the BibTeX entries of plugins. Plugins with the same source have one entry, which lists the plugins."""
    sources: dict[str, tuple[str, list[str]]] = {}
    for cls, title in used.items():
        if hasattr(cls, "citations"):
            yield from cls.citations
        for doi, before in _sources(cls):
            sources.setdefault(doi, (before, []))[1].append(title)
    yield from (entry(doi, before, titles) for doi, (before, titles) in sources.items())


def entry(doi: str, before: str, titles: Iterable[str]) -> str:
    """Return the BibTeX entry of one source (a paper with a DOI).

    Args:
        doi: DOI of the source.
        before: text before the DOI in the docstring, with the authors, the title in quotation marks, and the year.
        titles: names of the plugins that implement the method of this source.
    """
    read = TITLED.search(before) or UNTITLED.search(before)
    known = {name: text for name, text in (read.groupdict() if read else {}).items() if text}
    if "author" in known:
        known["author"] = _authors(known["author"])
    years = YEAR.findall(before[read.start() :] if read else before[-80:])
    known |= {"year": years[-1]} if years else {}
    return _bibtex("misc", re.sub(r"\W+", "_", doi), known | {"doi": doi, "note": f"jerkbench: {', '.join(titles)}"})


def package_entry() -> str:
    """Return the BibTeX entry of this package, from its citation file."""
    from omegaconf import OmegaConf

    package = Path(__file__).parents[1]
    outside, inside = package.parent / PACKAGE_CITATION, package / PACKAGE_CITATION
    cited: Any = OmegaConf.to_container(OmegaConf.load(outside if outside.is_file() else inside))
    fields = {
        "author": " and ".join(f"{{{author['name']}}}" for author in cited["authors"]),
        "title": cited["title"],
        "year": str(cited["date-released"])[:4],
        "version": str(cited["version"]),
    }
    return _bibtex("software", "jerkbench", fields)


def _plugins(spec: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    for kind, part in spec.items():
        if kind in plugins.KINDS and isinstance(part, Mapping):
            yield kind, str(part["name"])
    yield from (("disturbance", str(part["name"])) for part in spec["disturbance"])


def _sources(cls: type) -> Iterator[tuple[str, str]]:
    """Yield each DOI in the docstrings of a plugin and its base classes, and the text that precedes the DOI."""
    for owner in (base for base in cls.__mro__ if base is not object and base.__doc__):
        text = " ".join(inspect.cleandoc(owner.__doc__ or "").split())
        yield from ((doi[1], text[: doi.start()]) for doi in DOI.finditer(text))


def _authors(text: str) -> str:
    """Return the authors in a reference as BibTeX expects them: names separated by "and".

    Text before the first initial of an author is ignored.
    """
    initial = INITIAL.search(text)
    names = re.split(r",? and |, (?=[A-Z]\.)" if initial else r",? and |, ", text[initial.start() if initial else 0 :])
    return " and ".join(name.strip() for name in names)


def _bibtex(kind: str, key: str, fields: Mapping[str, str]) -> str:
    width = max(map(len, fields))
    return "\n".join([f"@{kind}{{{key},", *(f"  {name:<{width}} = {{{text}}}," for name, text in fields.items()), "}"])
