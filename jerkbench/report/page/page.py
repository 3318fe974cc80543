"""The report as one HTML file: what was found, every cell, the figures, a reviewer's questions, where it comes from."""

import base64
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from jerkbench.report.findings import claims, findings
from jerkbench.report.html import html_table
from jerkbench.report.page.cells import cells_section
from jerkbench.report.quantities import quantity
from jerkbench.report.review import Check, Evidence, review
from jerkbench.report.summary import main_metric, summarise

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

FIGURE_DPI = 110


@dataclass(frozen=True, eq=False)
class Results:
    """All that a report is made of.

    Attributes:
        name: of the study.
        rows: one row a cell and seed.
        keys: key of the cell of each row.
        about: what is stored beside each cell's rows, by key.
        notes: sentences that belong under its tables.
        provenance: command, time, commit, versions, host.
    """

    name: str
    rows: "pd.DataFrame"
    keys: Sequence[str]
    about: Mapping[str, Mapping[str, Any]]
    notes: Sequence[str]
    provenance: Mapping[str, Any]


def page(results: Results, figures: Iterable[tuple[str, "Figure"]]) -> str:
    """Return the report; ``figures`` are captions with figures."""
    metric = main_metric(results.rows)
    evidence = Evidence(results.rows, list(results.about.values()), metric)
    sections = {
        "Findings": _findings(results.rows, metric),
        "Table": html_table(summarise(results.rows, metric, notes=results.notes, baseline=_baseline(results.rows))),
        "Cells": cells_section(results.rows, results.keys, results.about, metric),
        "Figures": "\n".join(_figure(caption, figure) for caption, figure in figures),
        "A reviewer's questions": _review(review(evidence)),
        "What is independent": _list(
            [note for note in results.notes if "ndependent of" in note] or ["Nothing is said."]
        ),
        "Provenance": f"<pre>{escape(json.dumps(results.provenance, indent=1))}</pre>",
    }
    links = "".join(f'<a href="#{_anchor(name)}">{escape(name)}</a>' for name in sections)
    body = "\n".join(f'<h2 id="{_anchor(n)}">{escape(n)}</h2>\n{text}' for n, text in sections.items())
    title, assets = escape(f"jerkbench: {results.name}"), files("jerkbench.report.page")
    style, script = (assets.joinpath(f"report.{end}").read_text(encoding="utf-8") for end in ("css", "js"))
    cells = f"{len(results.about)} cells, {len(results.rows)} runs, {quantity(metric).heading}"
    head = f'<meta charset="utf-8"><title>{title}</title>\n<style>{style}</style>'
    top = f"<h1>{title}</h1><p>{escape(cells)}</p><nav>{links}</nav>"
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head>{head}</head>\n'
        f"<body>{top}\n{body}\n<script>{script}</script></body></html>\n"
    )


def _baseline(rows: "pd.DataFrame") -> dict[str, str] | None:
    values = set(rows["adaptation"].astype(str))
    return {"adaptation": "none"} if "none" in values and len(values) > 1 else None


def _findings(rows: "pd.DataFrame", metric: str) -> str:
    """The paper's claim, what was shown, and behind a fold what was not."""
    found = findings(rows, metric)
    shown = [line for line in found if not line.startswith("No difference")]
    rest = [line for line in found if line.startswith("No difference")]
    more = f"<details><summary>{len(rest)} comparisons without a difference</summary>{_list(rest)}</details>"
    return _list([*claims(rows), *shown] or ["Nothing can be compared."]) + (more if rest else "")


def _review(checks: Sequence[Check]) -> str:
    words = {True: ("passed", "passed"), False: ("failed", "failed"), None: ("muted", "does not arise")}
    lines = [
        f'<tr><th scope="row">{escape(one.question)}</th><td class="{words[one.passed][0]}">{words[one.passed][1]}</td>'
        f"<td>{escape(one.reason)}</td></tr>"
        for one in checks
    ]
    return f'<table id="review">{"".join(lines)}</table>'


def _figure(caption: str, figure: "Figure") -> str:
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=FIGURE_DPI)
    encoded = base64.b64encode(data.getvalue()).decode()
    text = escape(caption)
    return f'<figure><img src="data:image/png;base64,{encoded}" alt="{text}"><figcaption>{text}</figcaption></figure>'


def _list(lines: Iterable[str]) -> str:
    return f"<ul>{''.join(f'<li>{escape(line)}</li>' for line in lines)}</ul>"


def _anchor(name: str) -> str:
    return "section-" + "".join(letter for letter in name.lower() if letter.isalpha())
