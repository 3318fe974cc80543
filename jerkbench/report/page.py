"""The report of a study as one HTML file: main result, tables, errors over time, figures, review and provenance."""

from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from itertools import accumulate
from typing import TYPE_CHECKING, Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.intervals import failures_text
from jerkbench.evaluation.judgement import WINS, Verdict
from jerkbench.report.columns import quantity
from jerkbench.report.comparisons import RULE, Comparison, Standing, VerdictRule
from jerkbench.report.findings import (
    against,
    answer,
    findings,
    mean_log_ratio,
    reference_method,
    rival_names,
    study_baselines,
)
from jerkbench.report.labels import METHOD_PARTS
from jerkbench.report.plots.studies import Picture
from jerkbench.report.review import review
from jerkbench.report.study_verdicts import across, study_verdicts
from jerkbench.report.summary import main_metric, summarise
from jerkbench.report.table_model import number
from jerkbench.report.writers import html_table, render

if TYPE_CHECKING:
    import pandas as pd
    from markupsafe import Markup


MAX_FINDINGS = 10
"""Maximum number of visible findings. Further findings are folded."""

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


# The content of sections: parameters of the methods, matrix of error ratios, and errors over time.


def settings(about: Iterable[Mapping[str, Any]]) -> list[tuple[str, str]]:
    """Return the name of each method, and text with the parameters of the method.

    The text lists the parameters of the filter and the adaptation, and the factors on R that are not 1, with all values
    that occur in the study.
    """
    values: dict[str, dict[str, dict[str, None]]] = {}
    for cell in about:
        seen = values.setdefault(" + ".join(str(cell["labels"][factor]) for factor in METHOD_PARTS), {})
        for kind in (*METHOD_PARTS, "r_scale"):
            for name, value in cell["spec"].get(kind, {}).items():
                if name != "name" and (kind, value) != ("r_scale", 1.0):
                    text = number(value) if isinstance(value, float) else str(value)
                    seen.setdefault(f"{kind}.{name}", {})[text] = None
    return [
        (method, ", ".join(f"{name} {' or '.join(list(of)[:MAX_FINDINGS])}" for name, of in seen.items()) or "none")
        for method, seen in values.items()
    ]


def matrix(standings: Sequence[Standing]) -> dict[str, Any] | None:
    """Return the matrix of error ratios of a study, or None if no comparison was tested.

    The matrix has a row for each method and a column for each scenario.
    """
    tested = [standing for standing in standings if standing.tested]
    if not tested:
        return None
    reference = reference_method(tested)
    scenarios = [", ".join(standing.scenario) or "the scenario" for standing in tested]
    seen = [against(standing, reference) for standing in tested]
    names = sorted(rival_names(tested), key=lambda name: mean_log_ratio(seen, name))
    rows = [[_matrix_cell(standing, seen[k], name, reference) for k, standing in enumerate(tested)] for name in names]
    return {"reference": reference, "columns": scenarios, "lines": list(zip(names, rows, strict=True))}


def _matrix_cell(
    standing: Standing, seen: Mapping[str, Comparison], name: str, reference: str
) -> dict[str, str | bool]:
    """Return the content of a cell: text (the ratio and the mark of the verdict), style, and number of failed runs.

    The style of a cell is better, worse, equal, undecided, reference or absent. The entry "leads" is True if the method
    is one of the best in the scenario.
    """
    cell: dict[str, str | bool] = {"leads": standing.decided and name in standing.leaders, "failed": ""}
    if name == reference and any(standing.name(rival) == name for rival in standing.rivals):
        return cell | {"text": "1", "style": "reference"}
    if name not in seen:
        return cell | {"text": "-", "style": "absent"}
    pair, judgement = seen[name], seen[name].judgement
    style = "undecided" if pair.verdict is Verdict.UNDECIDED else "equal"
    if pair.shown:
        style = "better" if pair.verdict in WINS else "worse"
    counts = judgement.failed[0], judgement.outlying[0]
    failed = failures_text(*counts, judgement.n, bound=False) if any(counts) else ""
    text = pair.ratio_text or ("failed" if judgement.ratio else "succeeds")
    return cell | {"text": text + pair.mark.strip("*"), "style": style, "failed": failed}


def largest_of_steps(t_s: FloatArray, error_m: FloatArray, edges_s: FloatArray) -> list[float | None]:
    """Return the largest of all errors that fall into each time step.

    Args:
        t_s: (k,) times of the errors [s].
        error_m: (k,) errors [m], or NaN for unknown errors.
        edges_s: (n + 1,) start of each of the n time steps, and end of the last time step [s].

    Returns:
        Largest error in each time step [m] with four digits, or None for a time step without a known error.
    """
    known = np.isfinite(error_m)
    index = np.clip(np.searchsorted(edges_s, t_s[known], side="right") - 1, 0, len(edges_s) - 2)
    largest = np.full(len(edges_s) - 1, -np.inf)
    np.maximum.at(largest, index, error_m[known])
    return [float(f"{error:.4g}") if np.isfinite(error) else None for error in largest]
