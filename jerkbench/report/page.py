"""The report of a study as one HTML file: main result, tables, errors over time, figures, review and provenance."""

from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from itertools import accumulate
from typing import TYPE_CHECKING, Any

from jerkbench.report.columns import quantity
from jerkbench.report.comparisons import RULE, VerdictRule
from jerkbench.report.findings import answer, findings, study_baselines
from jerkbench.report.page_content import MAX_FINDINGS, matrix, settings
from jerkbench.report.plots.studies import Picture
from jerkbench.report.review import review
from jerkbench.report.study_verdicts import across, study_verdicts
from jerkbench.report.summary import main_metric, summarise
from jerkbench.report.writers import html_table, render

if TYPE_CHECKING:
    import pandas as pd
    from markupsafe import Markup


_STYLES = ("report.css", "vendor/uplot/uPlot.min.css")
_SCRIPTS = ("vendor/uplot/uPlot.iife.min.js", "traces.js")
"""Style sheets and scripts of the page, in the order in which they are loaded."""


def page(
    name: str,
    rows: "pd.DataFrame",
    about: Mapping[str, Mapping[str, Any]],
    notes: Sequence[str],
    provenance: Mapping[str, Any],
    pictures: Sequence[Picture],
    curves: Sequence[Mapping[str, Any]] = (),
    *,
    rule: VerdictRule = RULE,
    method: tuple[str, ...] | None = None,
) -> str:
    """Return the report of a study as HTML.

    Args:
        name: name of the study.
        rows: one row for each job and seed.
        about: metadata of each job, by the key of the job.
        notes: notes below the tables.
        provenance: entries of the manifest: command, time, commit, versions of libraries, and computer.
        pictures: figures of the study.
        curves: errors over time of each scenario, as returned by `jerkbench.report.study_figures.draw_study`.
        rule: margin and level of the verdicts.
        method: factors that define a method, or None for the default of `study_verdicts`.
    """
    from markupsafe import Markup

    metric = main_metric(rows)
    checks = review(rows, list(about.values()), metric)
    verdicts = study_verdicts(rows, metric, method, rule)
    standings, sentences = verdicts.standings, findings(rows, verdicts)
    finished, failed = str(provenance.get("finished", ""))[:10], int((rows["status"] != "ok").sum())
    runs = f"runs, {failed or 'none'} diverged or failed"
    baseline = next(iter(study_baselines(rows, ["adaptation"])), None)
    table = summarise(rows, metric, notes=notes, baseline=baseline, verdicts=verdicts)
    return render(
        "page.html",
        name=name,
        styles=_assets(_STYLES),
        scripts=_assets(_SCRIPTS),
        subtitle=" · ".join(filter(None, ("jerkbench", quantity(metric).heading, finished))),
        tiles=[(len(about), "combinations"), (len(rows), runs)],
        answer=answer(standings),
        matrix=matrix(standings),
        settings=settings(about.values()),
        findings=sentences[:MAX_FINDINGS],
        more=sentences[MAX_FINDINGS:],
        across=across(verdicts),
        title=quantity(metric).heading,
        checks=checks,
        table=Markup(html_table(table, level=3)),  # noqa: S704 - its template escapes
        gallery=gallery(pictures, without=("errors",) if curves else ()),
        traces={"scenarios": curves},
        independence=[note for note in notes if "ndependent of" in note] or ["Not stated."],
        provenance=[(key, _plain(value)) for key, value in provenance.items()],
    )


def _assets(names: Iterable[str]) -> "list[Markup]":
    """Return the content of style sheets and scripts, marked as safe so that templates do not escape it."""
    from markupsafe import Markup

    remaining = files("jerkbench.report") / "assets"
    return [Markup(remaining.joinpath(name).read_text(encoding="utf-8")) for name in names]  # noqa: S704 - files of this package


def _plain(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_plain(entry)}" for key, entry in value.items())
    if isinstance(value, str) or not isinstance(value, Iterable):
        return str(value)
    return " ".join(map(str, value))


MAX_FIGURE_CHARACTERS = 600_000
"""Maximum number of characters of all encoded figures. This maximum limits the size of the report to 2 MB."""


def gallery(pictures: Iterable[Picture], without: Sequence[str] = ()) -> dict[str, Any]:
    """Return the figures of the complete study and of each scenario, and the names of scenarios without figures.

    The figures of the last scenarios are left out if they would make the page too large.

    Args:
        pictures: all figures of the study.
        without: figures whose names end with one of these texts are left out, because the page has interactive plots
            instead.
    """
    scenes: dict[str, list[Picture]] = {"": []}
    for picture in pictures:
        if not picture.name.endswith(tuple(f"-{end}" for end in without)):
            scenes.setdefault(picture.scenario, []).append(picture)
    sizes = accumulate(sum(len(picture.data) for picture in of_scene) for of_scene in scenes.values())
    (_, overview), *others = scenes.items()
    count = max(1, sum(size <= MAX_FIGURE_CHARACTERS for size in sizes) - 1)
    return {"overview": overview, "scenes": others[:count], "left_out": [name for name, _ in others[count:]]}
