"""The report of a study as one HTML file: main result, tables, errors over time, figures, review and provenance."""

import json
import re
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from itertools import accumulate
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.intervals import failures_text
from jerkbench.evaluation.judgement import WINS, Verdict
from jerkbench.evaluation.metrics.consistency import EXPECTED_ANEES
from jerkbench.report.columns import FACTORS, METHOD, SCENARIO_FACTORS, competes, quantity, with_metric
from jerkbench.report.comparisons import RULE, Comparison, Standing, VerdictRule
from jerkbench.report.findings import (
    across,
    against,
    answer,
    findings,
    mean_log_ratio,
    reference_method,
    rival_names,
    study_baselines,
    study_verdicts,
)
from jerkbench.report.labels import METHOD_PARTS, REUSED, TUNED_SUFFIX, UNTUNED_SUFFIX
from jerkbench.report.plots.studies import Picture
from jerkbench.report.summary import TUNED, JobMetadata, main_metric, summarise
from jerkbench.report.table_model import arranged, number, range_text
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


# The review: questions that a reviewer would have, and answers computed from the rows and configurations.

_MIN_SEEDS = 10
"""With fewer seeds, large differences are often not significant."""

MIN_SETTINGS = 3
"""Minimum number of settings in a sweep of a parameter."""

_CREDIBLE = 0.5, 2.0
"""Range in which the ratio of the ANEES to its expected value is accepted as approximately consistent."""

REPLACED = re.compile(r"(position|velocity|course|wheel)_(?:sigma|variance|covariance)_[a-z0-9]+")
"""Matches the names of parameters of a data set or a filter that replace the accuracy reported by the receiver."""

REPORTED = ("sigma", "variance", "covariance")
"""Last parts of the names of parameters that select a column with the reported accuracy.

If such a parameter is set, the reported accuracy is not replaced.
"""


class Check(NamedTuple):
    """One question that a reviewer would have, with its answer.

    Attributes:
        question: text of the question.
        passed: True if the study passes the check, False if the study fails, or None if the question does not apply.
        reason: text that explains the answer.
    """

    question: str
    passed: bool | None
    reason: str


def review(rows: "pd.DataFrame", cells: Sequence[JobMetadata], metric: str) -> list[Check]:
    """Return all questions of the review, with the answers for a study.

    Args:
        rows: one row for each job and seed.
        cells: metadata of each job: labels, spec, protocol, data, notes.
        metric: main metric of the study.
    """
    answers = {
        "Is the covariance of the receiver used?": _covariance(cells),
        "Were the baselines tuned with the same budget?": _budget(cells),
        "Is there more than one recording?": _recordings(cells),
        "Are there enough seeds?": _seeds(rows, cells),
        "Are the best filters approximately consistent?": _consistency(rows, metric),
        "Is the reference independent of the measurements?": _independence(cells),
    }
    return [Check(question, *answer) for question, answer in answers.items()]


Answered = tuple[bool | None, str]
"""The values of `Check.passed` and `Check.reason`."""


def _covariance(cells: Sequence[JobMetadata]) -> Answered:
    real = [cell["spec"] for cell in cells if cell["data"]]
    if not real:
        return None, "All recordings are simulated: the reported covariance is the covariance of the noise."
    replaced = sorted({name for spec in real for kind in ("dataset", "filter") for name in _replaced(spec[kind])})
    if replaced:
        return False, f"Replaced by parameters: {', '.join(replaced)}."
    return True, "The filters get R as the recordings report it."


def _replaced(part: Mapping[str, Any]) -> list[str]:
    """Return the names of parameters that replace an accuracy that the receiver reports."""
    replaced = []
    for key, value in part.items():
        match = REPLACED.fullmatch(key)
        if match is None or value in (None, [], ()) or part.get(f"{match[1]}_file") == "":
            continue
        if not any(part.get(f"{match[1]}_{end}") for end in REPORTED):
            replaced.append(f"{part['name']}.{key}")
    return replaced


def _budget(cells: Sequence[JobMetadata]) -> Answered:
    """Check that all methods were tuned with the same budget, or ran with the same number of parameter settings."""
    configured: dict[str, dict[str, set[str]]] = defaultdict(lambda: defaultdict(set))
    notes: dict[str, set[str]] = defaultdict(set)
    labelled = any(cell["labels"]["filter"].endswith(TUNED_SUFFIX) for cell in cells)
    for cell in cells:
        labels, parts = cell["labels"], [cell["spec"][kind] for kind in ("attitude", *METHOD_PARTS)]
        if competes(labels) and max(map(len, parts[1:])) > 1:
            scenario = json.dumps([cell["spec"]["dataset"], cell["data"], labels["disturbance"]], sort_keys=True)
            configured[_method(cell)][scenario].add(json.dumps(parts, sort_keys=True))
            label = " + ".join(labels[kind] for kind in METHOD_PARTS)
            tuned = labels["filter"].endswith(TUNED_SUFFIX) or not labelled
            notes[label].update([note for note in cell["notes"] if note.startswith(TUNED) and tuned] or [""])
    counts = {method: sorted({len(of) for of in tried.values()}) for method, tried in sorted(configured.items())}
    if not counts:
        return None, "No method has a parameter."
    if budgets := sorted(set[str]().union(*notes.values()) - {""}):
        tuned_names = {label.replace(TUNED_SUFFIX, "") for label in notes if TUNED_SUFFIX in label}
        others = {method: method.replace(UNTUNED_SUFFIX, "") for method, of in notes.items() if "" in of}
        untuned = ", ".join(method for method, name in others.items() if name not in tuned_names)
        return len(budgets) == 1 and not untuned, " ".join(budgets) + f" Not tuned: {untuned}." * bool(untuned)
    passed = len({count for of in counts.values() for count in of}) == 1 and min(counts.values())[0] >= MIN_SETTINGS
    text = ", ".join(f"{method} {range_text(of)}" for method, of in counts.items())
    return passed, f"Settings of each method: {text}. Required: the same number for all, and at least {MIN_SETTINGS}."


def _method(cell: Mapping[str, Any]) -> str:
    return " + ".join(cell["spec"][kind]["name"] for kind in METHOD_PARTS)


def _recordings(cells: Sequence[JobMetadata]) -> Answered:
    """Check that each method ran on at least two recordings. Recordings with equal data count as one recording."""
    names = sorted({cell["labels"]["dataset"] for cell in cells})
    runs: dict[str, set[str]] = defaultdict(set)
    for cell in cells:
        runs[_method(cell)].add(cell["data"] or f"simulated {cell['spec']['dataset']['name']}")
    different = {recording for recordings in runs.values() for recording in recordings}
    once = sorted(method for method, recordings in runs.items() if len(recordings) < 2)
    real = sum(not recording.startswith("simulated ") for recording in different)
    text = f"{len(different)} recording{'s' * (len(different) > 1)}, {real} of them real: {', '.join(names)}."
    if len(different) > 1 and once:
        text += f" Only on one recording: {', '.join(once)}."
    return not once, text


def _seeds(rows: "pd.DataFrame", cells: Sequence[JobMetadata]) -> Answered:
    """Check that each combination has enough successful seeds that no tuning used, the same for all its methods."""
    seeded = rows[rows["replicate"] == "seed"]
    # A row without a seed is a phase of a recording, or the single run of a combination without random parts.
    per_cell = rows[rows["replicate"] == "phase"].groupby([*FACTORS]).size()
    phases, single = int(per_cell[per_cell > 1].sum()), int((per_cell == 1).sum())
    more = f" {single} rows are the one run of a recording in which nothing is random." if single else ""
    more += f" {phases} rows are phases of recordings, which are not independent." if phases else ""
    if len(seeded) == 0:
        return False, f"No seeds:{more}"
    well = (seeded["status"] == "ok").groupby([seeded[key] for key in FACTORS]).sum()
    drawn = seeded.groupby([*FACTORS])["seed"].agg(lambda seeds: str(sorted(seeds)))
    same = drawn.groupby(level=["dataset", "disturbance", "attitude"]).nunique().max() == 1
    other = "" if same else " Combinations of one scenario have different seeds."
    reused = [f" {note}" for cell in cells for note in cell["notes"] if note.startswith(REUSED)][:1]
    passed = bool(well.min() >= _MIN_SEEDS and not more and same and not reused)
    required = f"{range_text(well)} successful seeds for each combination; required: {_MIN_SEEDS}."
    return passed, "".join([required, other, more, *reused])


def _consistency(rows: "pd.DataFrame", metric: str) -> Answered:
    if "anees" not in rows or rows["anees"].isna().all():
        return False, "NEES was not computed, or no reference allows it."
    grid = arranged(with_metric(rows, metric), SCENARIO_FACTORS, METHOD)
    good = [
        (cell.mean, combination)
        for combination, cell in grid.cells(metric).items()
        if cell.complete and competes(dict(zip(FACTORS, combination, strict=True)))
    ]
    best = {combination[:3]: combination for _, combination in sorted(good, reverse=True)}  # the lowest error is last
    scenarios = len(grid.row_values)
    if len(best) < scenarios:
        return False, f"On {scenarios - len(best)} of {scenarios} scenarios every method has failed runs."
    anees = grid.cells("anees")
    ratios = [anees[combination].mean / EXPECTED_ANEES for combination in best.values()]
    wrong = sum(not _CREDIBLE[0] <= ratio <= _CREDIBLE[1] for ratio in ratios)
    value = f"{min(ratios):.2g} to {max(ratios):.2g} times the expected value {EXPECTED_ANEES:g}"
    found = f"The ANEES of the best method of each scenario is {value}. Accepted: {_CREDIBLE[0]:g} to {_CREDIBLE[1]:g}."
    return not wrong, found + f" Not accepted in {wrong} of {scenarios} scenarios." * bool(wrong)


def _independence(cells: Sequence[JobMetadata]) -> Answered:
    """Check that the source of the reference of each data set is stated, and is independent of the measurements."""
    notes: dict[str, dict[str, None]] = defaultdict(dict)
    for cell in cells:
        found = [note for note in cell["notes"] if note.startswith("Reference of ")]
        notes[cell["labels"]["dataset"]].update(dict.fromkeys(found))
    silent = [name for name, found in notes.items() if not found]
    text = list(dict.fromkeys(note for found in notes.values() for note in found))
    if silent:
        text.append(f"The source of the reference is not stated: {', '.join(silent)}.")
    return not silent and not any("not independent of" in note for note in text), " ".join(text)
