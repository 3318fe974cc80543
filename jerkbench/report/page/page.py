"""The report as one HTML file: what was found, the table, figures, a reviewer's questions, every cell, provenance."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.analysis.review import Check, Evidence, review
from jerkbench.report.page.cells import by_combination, cells_section, combinations
from jerkbench.report.page.first_screen import findings_section
from jerkbench.report.page.gallery import gallery
from jerkbench.report.page.text import bullets
from jerkbench.report.plots.picture import Picture
from jerkbench.report.tables.html import html_table
from jerkbench.report.tables.summary import main_metric, summarise

if TYPE_CHECKING:
    import pandas as pd

WORDS = {True: ("passed", "passed"), False: ("failed", "failed"), None: ("muted", "does not arise")}
"""Class and word of an answer."""


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


def page(results: Results, pictures: Sequence[Picture]) -> str:
    """Return the report."""
    rows, metric = results.rows, main_metric(results.rows)
    leading = combinations(rows, metric)
    checks = review(Evidence(rows, list(results.about.values()), metric))
    independence = [note for note in results.notes if "ndependent of" in note]
    sections = {
        "Findings": findings_section(rows, metric, leading.title, by_combination(leading)),
        "Table": html_table(summarise(rows, metric, notes=results.notes, baseline=_baseline(rows)), level=3),
        "Figures": gallery(pictures),
        "A reviewer's questions": _review(checks),
        "Every cell": cells_section(rows, results.keys, results.about, metric),
        "What is independent": bullets(independence or ["Nothing is said."]),
        "Provenance": _provenance(results.provenance),
    }
    links = "".join(f'<a href="#{_anchor(name)}">{escape(name)}</a>' for name in sections)
    body = "\n".join(
        f'<section id="{_anchor(n)}"><h2>{escape(n)}</h2>\n{text}</section>' for n, text in sections.items()
    )
    return _document(results.name, f"{_tiles(results, checks, quantity(metric).heading)}<nav>{links}</nav>", body)


def _document(name: str, top: str, body: str) -> str:
    assets = files("jerkbench.report.page")
    style, script = (assets.joinpath(f"report.{end}").read_text(encoding="utf-8") for end in ("css", "js"))
    title = escape(f"jerkbench: {name}")
    head = '<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">'
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head>{head}<title>{title}</title>\n<style>{style}</style></head>\n'
        f"<body><header><h1>{escape(name)}</h1>{top}</header>\n{body}\n<script>{script}</script></body></html>\n"
    )


def _tiles(results: Results, checks: Sequence[Check], title: str) -> str:
    """The size of the study, what was lost, and how the review went."""
    rows = results.rows
    lost = int((rows["status"] != "ok").sum())
    asked = [one for one in checks if one.passed is not None]
    passed = sum(bool(one.passed) for one in asked)
    finished = str(results.provenance.get("finished", ""))[:10]
    tiles = [
        (f"{len(results.about)}", "combinations"),
        (f"{len(rows)}", f"runs, {lost} of them lost"),
        (f"{passed} of {len(asked)}", "of a reviewer's questions passed"),
    ]
    shown = "".join(f"<div><strong>{escape(value)}</strong> {escape(text)}</div>" for value, text in tiles)
    words = " · ".join(part for part in ("jerkbench", title, finished) if part)
    return f'<p class="muted">{escape(words)}</p><div class="tiles">{shown}</div>'


def _baseline(rows: "pd.DataFrame") -> dict[str, str] | None:
    values = set(rows["adaptation"].astype(str))
    return {"adaptation": "none"} if "none" in values and len(values) > 1 else None


def _review(checks: Sequence[Check]) -> str:
    lines = [
        f'<tr><th scope="row">{escape(one.question)}</th><td class="{WORDS[one.passed][0]}">{WORDS[one.passed][1]}</td>'
        f"<td>{escape(one.reason)}</td></tr>"
        for one in checks
    ]
    return f'<div class="wide"><table id="review">{"".join(lines)}</table></div>'


def _provenance(told: Mapping[str, Any]) -> str:
    lines = "".join(f"<dt>{escape(name)}</dt><dd>{escape(_plain(value))}</dd>" for name, value in told.items())
    return f"<dl>{lines}</dl>"


def _plain(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_plain(one)}" for key, one in value.items())
    if isinstance(value, str) or not isinstance(value, Iterable):
        return str(value)
    return " ".join(map(str, value))


def _anchor(name: str) -> str:
    return "section-" + "".join(letter for letter in name.lower() if letter.isalpha())
