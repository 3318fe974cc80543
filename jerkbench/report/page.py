"""The report as one HTML file: the answer, the table, errors over time, figures, a review, every cell, provenance."""

import base64
import io
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from typing import TYPE_CHECKING, Any, NamedTuple

from jerkbench.report.columns import quantity
from jerkbench.report.comparisons import RULE, VerdictRule, verdict_sentences
from jerkbench.report.drawings import Picture
from jerkbench.report.findings import answer, compared, strongest, study_baselines, varying_factors
from jerkbench.report.page_content import (
    MAX_FINDINGS,
    Stretch,
    cells_view,
    every_comparison,
    matrix,
    packed_json,
    payload,
    settings,
)
from jerkbench.report.plots.style import Palette
from jerkbench.report.review import Evidence, review
from jerkbench.report.study_verdicts import across, study_verdicts
from jerkbench.report.summary import main_metric, summarise
from jerkbench.report.writers import html_table, render

if TYPE_CHECKING:
    import pandas as pd
    from markupsafe import Markup


_WORDS = {True: ("passed", "passed"), False: ("failed", "failed"), None: ("muted", "does not arise")}
"""Class and word of an answer."""

_STYLES = ("report.css", "vendor/uplot/uPlot.min.css")
_SCRIPTS = ("vendor/uplot/uPlot.iife.min.js", "report.js", "traces.js")
"""What the page carries, in this order."""

_METHOD = ("attitude", "filter", "adaptation", "noise")
"""Factors that tell the lines of one figure apart."""


class Results(NamedTuple):
    """All that a report is made of.

    Attributes:
        name: of the study.
        rows: one row a cell and seed.
        keys: key of the cell of each row.
        about: what is stored beside each cell's rows, by key.
        notes: sentences that belong under its tables.
        provenance: command, time, commit, versions, host.
        rule: how differences are judged.
        method: factors that make a method; None: those that vary.
    """

    name: str
    rows: "pd.DataFrame"
    keys: Sequence[str]
    about: Mapping[str, Mapping[str, Any]]
    notes: Sequence[str]
    provenance: Mapping[str, Any]
    rule: VerdictRule = RULE
    method: tuple[str, ...] | None = None


def page(results: Results, pictures: Sequence[Picture], stretches: Sequence[Stretch] = ()) -> str:
    """Return the report."""
    from markupsafe import Markup

    rows, metric = results.rows, main_metric(results.rows)
    checks = review(Evidence(rows, list(results.about.values()), metric))
    verdicts = study_verdicts(rows, metric, results.method, results.rule)
    standings, findings = verdicts.standings, strongest(verdicts.standings)
    cells = cells_view(rows, results.keys, results.about, metric, verdicts)
    finished, lost = str(results.provenance.get("finished", ""))[:10], int((rows["status"] != "ok").sum())
    of_them = " of them" if lost else ""
    baseline = next(iter(study_baselines(rows, ["adaptation"])), None)
    table = summarise(rows, metric, notes=results.notes, baseline=baseline, verdicts=verdicts)
    return render(
        "page.html",
        name=results.name,
        styles=_assets(_STYLES),
        scripts=_assets(_SCRIPTS),
        subtitle=" · ".join(filter(None, ("jerkbench", quantity(metric).heading, finished))),
        tiles=[(f"{len(results.about)}", "combinations"), (f"{len(rows)}", f"runs, {lost or 'none'}{of_them} lost")],
        answer=answer(standings),
        matrix=matrix(standings),
        settings=settings(results.about.values()),
        summary=verdict_sentences(standings),
        findings=findings[:MAX_FINDINGS],
        more=findings[MAX_FINDINGS:],
        across=across(rows, verdicts, metric),
        every=every_comparison(compared(rows, verdicts), varying_factors(rows)),
        title=quantity(metric).heading,
        objections=[check for check in checks if check.passed is False],
        answered=sum(check.passed is not None for check in checks),
        table=Markup(html_table(table, level=3)),  # noqa: S704 - its template escapes
        gallery=gallery(pictures, without=("errors", "zoom") if stretches else ()),
        checks=[(check, *_WORDS[check.passed]) for check in checks],
        cells=cells,
        details=packed_json(cells["details"]),
        traces=_traces(results.about, stretches),
        independence=[note for note in results.notes if "ndependent of" in note] or ["Nothing is said."],
        provenance=[(name, _plain(value)) for name, value in results.provenance.items()],
    )


def _assets(names: Iterable[str]) -> "list[Markup]":
    """Return files of this package as they are: styles and scripts are no text to escape."""
    from markupsafe import Markup

    room = files("jerkbench.report") / "assets"
    return [Markup(room.joinpath(name).read_text(encoding="utf-8")) for name in names]  # noqa: S704 - our own files


def _traces(about: Mapping[str, Mapping[str, Any]], stretches: Sequence[Stretch]) -> dict[str, Any]:
    labels = {key: {name: str(value) for name, value in metadata["labels"].items()} for key, metadata in about.items()}
    varying = [name for name in _METHOD if len({label[name] for label in labels.values()}) > 1] or ["filter"]
    names = {key: " + ".join(label[name] for name in varying) for key, label in labels.items()}
    methods = {key: (label["filter"], label["adaptation"]) for key, label in labels.items()}
    palette = Palette.of(methods.values())
    looks = {key: palette.look(method) for key, method in methods.items()}
    styles = {key: {"colour": look.colour, "dash": list(look.dash)} for key, look in looks.items()}
    return payload(stretches, styles, names)


def _plain(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_plain(entry)}" for key, entry in value.items())
    if isinstance(value, str) or not isinstance(value, Iterable):
        return str(value)
    return " ".join(map(str, value))


ROOM = 600_000
"""Letters that all figures of a page take together: the file stays below 2 MB."""


class Shown(NamedTuple):
    """A figure on the page.

    Attributes:
        caption: what it shows.
        data: the picture, as an address that holds it.
        width: in pixels.
        height: in pixels.
    """

    caption: str
    data: str
    width: int
    height: int


class Gallery(NamedTuple):
    """The figures of a page.

    Attributes:
        overview: those of all rows.
        scenes: name of each scenario, with its figures.
        left_out: scenarios for which there was no room.
    """

    overview: list[Shown]
    scenes: list[tuple[str, list[Shown]]]
    left_out: list[str]


def gallery(pictures: Sequence[Picture], without: Sequence[str] = ()) -> Gallery:
    """Return the figures of a page.

    Args:
        pictures: all that there are.
        without: ends of the names of those that the page shows in another way.
    """
    scenes: dict[str, list[Picture]] = {"": []}
    for picture in pictures:
        if not picture.name.endswith(tuple(f"-{end}" for end in without)):
            scenes.setdefault(picture.scenario, []).append(picture)
    overview = [_shown(picture) for picture in scenes.pop("")]
    room = ROOM - sum(len(one.data) for one in overview)
    shown: list[tuple[str, list[Shown]]] = []
    for name, ones in scenes.items():
        if room <= 0:
            break
        figures = [_shown(picture) for picture in ones]
        room -= sum(len(one.data) for one in figures)
        if room >= 0 or not shown:
            shown.append((name, figures))
    return Gallery(overview, shown, list(scenes)[len(shown) :])


def _shown(picture: Picture) -> Shown:
    """Return a picture as WebP, without a loss: two thirds of a PNG."""
    from PIL import Image

    data = io.BytesIO()
    with Image.open(io.BytesIO(picture.png)) as image:
        image.convert("RGB").save(data, "webp", lossless=True, quality=50, method=3)
        width, height = image.size
    encoded = base64.b64encode(data.getvalue()).decode()
    return Shown(picture.caption, f"data:image/webp;base64,{encoded}", width, height)
