"""What a report shows beside tables and figures: methods x scenarios, settings, comparisons, every cell."""

import base64
import gzip
import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.consistency_verdict import NEAR, UNKNOWN, runs_verdict
from jerkbench.evaluation.evaluated_run import Combination
from jerkbench.evaluation.intervals import failures_text, up_to
from jerkbench.evaluation.judgement import WINS, Verdict
from jerkbench.evaluation.metrics.consistency import EXPECTED_ANEES
from jerkbench.evaluation.over_seeds import MIN_BOOTSTRAP
from jerkbench.report.columns import FACTORS, SCENARIO_FACTORS, metric_columns, quantity
from jerkbench.report.comparisons import Comparison, Standing
from jerkbench.report.findings import against, mean_log_ratio, reference_method, sentence, size_text, study_baselines
from jerkbench.report.study_verdicts import StudyVerdicts
from jerkbench.report.summary import summarise
from jerkbench.report.table_model import TableCell, number

if TYPE_CHECKING:
    import pandas as pd


MAX_FINDINGS = 10
"""So many findings are read; the others are behind a fold."""

_PARTS = ("filter", "adaptation")
"""Parts of a method; the noise is among the parameters of the filter."""


def settings(about: Iterable[Mapping[str, Any]]) -> list[tuple[str, int, str]]:
    """Return each method's parameters, of the filter and the adaptation.

    Of each there is its name, with how many settings it ran in a scenario (the most), and every parameter with its
    value, or with its values where there are several.
    """
    values: dict[str, dict[str, dict[str, None]]] = {}
    tried: dict[str, dict[tuple[str, str], set[str]]] = {}
    for cell in about:
        spec, labels = cell["spec"], cell["labels"]
        method = " + ".join(str(labels[factor]) for factor in _PARTS)
        own = {f"{kind}.{name}": value for kind in _PARTS for name, value in spec[kind].items() if name != "name"}
        seen = values.setdefault(method, {})
        for name, value in own.items():
            seen.setdefault(name, {})[number(value) if isinstance(value, float) else str(value)] = None
        scenario = (str(labels["dataset"]), str(labels["disturbance"]))
        tried.setdefault(method, {}).setdefault(scenario, set()).add(json.dumps(own, sort_keys=True, default=str))
    told = {
        method: ", ".join(f"{name} {' or '.join(list(of)[:MAX_FINDINGS])}" for name, of in seen.items()) or "none"
        for method, seen in values.items()
    }
    return [(method, max(map(len, tried[method].values())), parameters) for method, parameters in told.items()]


def every_comparison(comparisons: Iterable[Comparison], varying: Sequence[str]) -> list[tuple[str, list[str]]]:
    """Return a heading for each scenario, and its comparisons in sentences, those that were shown first."""
    shown = [key for key in SCENARIO_FACTORS if key in varying]
    scenes: dict[str, list[Comparison]] = {}
    for comparison in comparisons:
        scenes.setdefault(", ".join(getattr(comparison.subject, key) for key in shown), []).append(comparison)
    told = []
    for name, of_scene in scenes.items():
        counts = Counter(comparison.verdict.value for comparison in of_scene)
        words = ", ".join(f"{count} {word}" for word, count in counts.items())
        tested = any(not math.isnan(comparison.judgement.p) for comparison in of_scene)
        result = f": {words}" if tested else ", without a test (no seeds)"
        ordered = sorted(of_scene, key=lambda comparison: not comparison.shown)
        heading = f"{f'{name}: ' if name else ''}{len(of_scene)} comparisons{result}"
        told.append((heading, [sentence(comparison, varying) for comparison in ordered]))
    return told


# The picture of a study: methods x scenarios, each error relative to one reference, coloured where it was shown.

SHADES = (1.1, 1.5)
"""Factors from which on a shown difference has the second and the third shade."""

MANY_SCENARIOS = 8
"""With more scenarios than this they stand in rows, if the methods are fewer."""


class MatrixCell(NamedTuple):
    """One method in one scenario.

    Attributes:
        text: ratio of its error to that of the reference.
        style: better1 to better3, worse1 to worse3, equal, undecided, reference or absent.
        hint: the comparison in words.
        lost: its lost or locked out runs, or nothing.
        leads: whether it is in the leading group of the scenario.
    """

    text: str
    style: str
    hint: str = ""
    lost: str = ""
    leads: bool = False


class Matrix(NamedTuple):
    """Methods x scenarios.

    Attributes:
        reference: name of the method with the ratio 1.
        corner: what stands in the rows.
        columns: heads of the columns.
        lines: label of each row, and its cells.
        worst: of each method, its largest ratio and the scenario of that.
    """

    reference: str
    corner: str
    columns: tuple[str, ...]
    lines: list[tuple[str, list[MatrixCell]]]
    worst: list[tuple[str, str, str]]


def matrix(standings: Sequence[Standing]) -> Matrix | None:
    """Return the picture of a study; None without two compared methods."""
    tested = [standing for standing in standings if standing.tested]
    if not tested:
        return None
    reference = reference_method(tested)
    names = list(dict.fromkeys(standing.name(rival) for standing in tested for rival in standing.rivals))
    scenarios = [", ".join(standing.scenario) or "the scenario" for standing in tested]
    seen = [against(standing, reference) for standing in tested]
    names.sort(key=lambda name: mean_log_ratio(seen, name))
    rows = [[_matrix_cell(standing, seen[k], name, reference) for k, standing in enumerate(tested)] for name in names]
    worst = []
    for name in names:
        pairs = [(of[name], scenario) for of, scenario in zip(seen, scenarios, strict=True) if name in of]
        if pairs:
            pair, scenario = max(pairs, key=lambda one: one[0].judgement.ratio)
            worst.append((name, _ratio(pair), scenario))
    if len(scenarios) > MANY_SCENARIOS and len(scenarios) > len(names):
        turned = [list(cells) for cells in zip(*rows, strict=True)]
        return Matrix(reference, "scenario", tuple(names), list(zip(scenarios, turned, strict=True)), worst)
    return Matrix(reference, "method", tuple(scenarios), list(zip(names, rows, strict=True)), worst)


def _matrix_cell(standing: Standing, seen: Mapping[str, Comparison], name: str, reference: str) -> MatrixCell:
    leads = standing.decided and name in standing.leaders
    if name == reference and any(standing.name(rival) == name for rival in standing.rivals):
        return MatrixCell("1", "reference", "the reference", leads=leads)
    pair = seen.get(name)
    if pair is None:
        return MatrixCell("-", "absent")
    judgement, ratio = pair.judgement, pair.judgement.ratio
    style, hint = "undecided" if pair.verdict is Verdict.UNDECIDED else "equal", pair.verdict.value
    if pair.shown:
        factor = max(ratio, 1 / ratio) if 0 < ratio < math.inf else math.inf
        word = "better" if pair.verdict in WINS else "worse"
        style, hint = f"{word}{1 + sum(factor >= step for step in SHADES)}", size_text(judgement)
    if 0 < judgement.low <= judgement.high < math.inf:
        hint += f"; ratio 95 % {number(judgement.low)} to {number(judgement.high)}"
    counts = judgement.failed[0], judgement.outlying[0]
    lost = failures_text(*counts, judgement.n, bound=False) if any(counts) else ""
    return MatrixCell(_ratio(pair), style, hint, lost, leads)


def _ratio(pair: Comparison) -> str:
    return pair.ratio_text or ("lost" if pair.judgement.ratio else "finishes")


# Every cell of a study: a table to sort and to filter, with a word on how sure of itself each filter is.


_COLUMNS = ("velocity_rmse_mps", "outage_rmse_m", "lockout_s", "anees", "anis_per_row")
"""Metrics that get a column after the leading one, where they have values; a cell that is opened shows all."""


CellEntry = tuple[str, str, str, bool]
"""What is shown, an interval beside it, the number to sort by; whether a narrow screen does without it."""


def cells_view(
    rows: "pd.DataFrame",
    keys: Sequence[str],
    about: Mapping[str, Mapping[str, Any]],
    metric: str,
    verdicts: StudyVerdicts,
) -> dict[str, Any]:
    """Return the table of every cell, as its template reads it.

    Args:
        rows: one row a cell and seed.
        keys: key of the cell of each row.
        about: what is stored beside each cell's rows, by key.
        metric: the leading metric.
        verdicts: of the study.
    """
    others = (column for column in _COLUMNS if column != metric and column in rows and rows[column].notna().any())
    metrics = [metric, *others]
    tables = [summarise(rows, of, row_keys=FACTORS[:-1], column_keys=FACTORS[-1:], leaders=False) for of in metrics]
    cells = [{tuple(labels[factor] for factor in FACTORS): cell for labels, cell in of.placed()} for of in tables]
    baselines = study_baselines(rows, ["adaptation"])
    ratios = {comparison.subject: comparison for of in baselines for comparison in verdicts.against(of)}
    by_key = rows.assign(key=list(keys)).groupby("key", sort=False)
    groups = {str(key): group for key, group in by_key}
    factors = tuple(key for key in FACTORS if len(rows[key].unique()) > 1) or ("filter",)
    scenarios: dict[tuple[str, ...], list[dict[str, Any]]] = {}
    for key, group in groups.items():
        combination = Combination(*(str(group[factor].iloc[0]) for factor in FACTORS))
        lines = scenarios.setdefault(combination[:2], [])
        lost = int((group["status"] != "ok").sum())
        bound = up_to(lost, len(group)) if (group["replicate"] == "seed").all() else ""
        line = {
            "key": key,
            "labels": [getattr(combination, factor) for factor in factors],
            "entries": [
                *(_mean(of[combination], extra=k > 0) for k, of in enumerate(cells)),
                *[_factor(ratios.get(combination))] * bool(ratios),
                (f"{lost} of {len(group)}", bound, str(lost), True),
            ],
            "verdict": nees_verdict(group),
            "rule": "group" if len(scenarios) > 1 and not lines else "",  # another scenario begins
        }
        lines.append(line)
    against = ("times none",) if ratios else ()
    return {
        "constants": ", ".join(f"{key} {rows[key].iloc[0]}" for key in FACTORS if key not in factors),
        "factors": factors,
        "choices": {key: list(dict.fromkeys(rows[key].astype(str))) for key in factors},
        "heads": (*(quantity(column).heading for column in metrics), *against, "lost runs"),
        "lines": [line for lines in scenarios.values() for line in lines],
        "explanation": nees_explanation(rows),
        "details": details(groups, about, [column for column in metrics if column in rows]),
    }


def _mean(cell: TableCell, *, extra: bool) -> CellEntry:
    known = cell.number and not math.isnan(cell.mean)
    sorting = "" if not known else "Infinity" if math.isinf(cell.mean) else f"{cell.mean:.7g}"
    return cell.number or cell.trouble, cell.interval, sorting, extra


def _factor(comparison: Comparison | None) -> CellEntry:
    """The ratio to no adaptation, with its mark."""
    if comparison is None or not comparison.ratio_text:
        return "", "", "", True
    return f"{comparison.ratio_text}{comparison.mark}", "", f"{comparison.judgement.ratio:.7g}", True


HEADING = "NEES says"
ANEES = "anees"


def nees_explanation(rows: "pd.DataFrame") -> str:
    """Return how to read the column; nothing where no cell has a value to judge."""
    if ANEES not in rows or rows[ANEES].isna().all():
        return ""
    low, high = (factor * EXPECTED_ANEES for factor in NEAR)
    return (
        f"{HEADING}: overconfident or too cautious where the whole interval of the ANEES over the seeds is above or "
        f"below {EXPECTED_ANEES:g}; consistent where it holds {EXPECTED_ANEES:g} and lies within {low:g} to {high:g}; "
        "not known where it holds more than that, of one run and of phases. For fewer than "
        f"{MIN_BOOTSTRAP} seeds the interval is Student's on the logarithms. If runs failed, the others can only be "
        "overconfident or not known."
    )


def nees_verdict(group: "pd.DataFrame") -> str:
    """Return the verdict on the rows of one cell; phases of one recording are no independent runs."""
    if ANEES not in group:
        return ""
    if (group["replicate"] == "phase").any():
        return UNKNOWN
    well = group["status"] == "ok"
    values = group.loc[well, ANEES].to_numpy(dtype=float)
    return runs_verdict(values, EXPECTED_ANEES, failed=int((~well).sum()))


# What the page's script reads: errors over time, two bytes each, and all that is known of each cell.

LOWEST, MAX_AXIS_M = 1e-9, 1e9
"""Metres between which an error is told; beyond them it is set to the nearest."""

LEVELS = 65534
"""Steps of the logarithm: neighbours are 0.06 % apart."""


class Stretch(NamedTuple):
    """The errors of several cells over the same recording.

    Attributes:
        scenario: name of the scenario.
        draw: which run it is, such as "seed 0".
        start_s: begin of the first step.
        step_s: length of a step.
        outages_s: (k, 2) begin and end of each outage.
        errors_m: key of the cell -> (n,) largest length of the position error in each step, NaN where there is none.
    """

    scenario: str
    draw: str
    start_s: float
    step_s: float
    outages_s: FloatArray
    errors_m: Mapping[str, FloatArray]


def largest_of_steps(t_s: FloatArray, error_m: FloatArray, edges_s: FloatArray) -> FloatArray:
    """Return (n,) the largest of ``error_m`` (k,) in each step between ``edges_s`` (n + 1,); NaN in one without any."""
    known = np.isfinite(error_m)
    place = np.clip(np.searchsorted(edges_s, t_s[known], side="right") - 1, 0, len(edges_s) - 2)
    largest = np.full(len(edges_s) - 1, -np.inf)
    np.maximum.at(largest, place, error_m[known])
    return np.where(np.isinf(largest), np.nan, largest)


def encoded(error_m: FloatArray) -> str:
    """Return errors [m] as text: of each the logarithm in 65534 steps from 1 on, 0 where there is none; base64."""
    span = np.log10(MAX_AXIS_M / LOWEST)
    with np.errstate(invalid="ignore"):
        share = np.log10(np.clip(error_m, LOWEST, MAX_AXIS_M) / LOWEST) / span
    steps = np.where(np.isnan(share), 0, 1 + np.round(np.nan_to_num(share) * LEVELS))
    return base64.b64encode(steps.astype("<u2").tobytes()).decode()


def payload(stretches: Sequence[Stretch], styles: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
    """Return what the page's script reads.

    Args:
        stretches: of each scenario.
        styles: colour and dashes of each cell's line, by key.
        names: of each cell's method, by key.
    """
    scenarios = [
        {
            "name": stretch.scenario,
            "draw": stretch.draw,
            "start": round(stretch.start_s, 6),
            "step": round(stretch.step_s, 6),
            "outages": np.round(stretch.outages_s, 3).tolist(),
            "lines": [
                {"key": key, "name": names[key], **styles[key], "error": encoded(error)}
                for key, error in stretch.errors_m.items()
            ],
        }
        for stretch in stretches
        if stretch.errors_m
    ]
    decades = float(np.log10(MAX_AXIS_M / LOWEST))
    return {"lowest": LOWEST, "decades": decades, "levels": LEVELS, "scenarios": scenarios}


_TOLD = ("protocol", "data", "notes", "created", "seconds", "commit", "versions")
"""What of a cell's record is told beside its configuration."""


_EACH = 3
"""So many metrics are told of each run, the first ones; of the others the spread."""


Numbered = dict[str, tuple[int, Any]]
"""Values that stand once, by their JSON: the number of each, and the value."""


def details(
    groups: "Mapping[str, pd.DataFrame]", about: Mapping[str, Mapping[str, Any]], metrics: Sequence[str]
) -> dict[str, Any]:
    """Return what the page's script shows of a cell that is opened.

    Args:
        groups: rows of each cell, by its key.
        about: what is stored beside them.
        metrics: those of the table, the leading one first.
    """
    shared: Numbered = {}
    cells = {key: _cell(group, about[key], metrics, shared) for key, group in groups.items()}
    seeds = [quantity(column).heading for column in metrics[:_EACH]]
    return {"shared": [value for _, value in shared.values()], "seeds": seeds, "cells": cells}


def _place(shared: Numbered, value: object) -> int:
    """Return the number of ``value``; the same for an equal one."""
    return shared.setdefault(json.dumps(value, sort_keys=True), (len(shared), value))[0]


def packed_json(content: Mapping[str, Any]) -> str:
    """Return ``content`` as JSON, by gzip and base64: a fifth as long."""
    text = json.dumps(content, separators=(",", ":"))
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()


def _cell(group: "pd.DataFrame", about: Mapping[str, Any], metrics: Sequence[str], shared: Numbered) -> dict[str, Any]:
    return {
        "labels": [[factor, str(about["labels"][factor])] for factor in FACTORS],
        "spec": {kind: _place(shared, part) for kind, part in about["spec"].items()},
        "told": {name: _place(shared, about[name]) for name in _TOLD},
        "metrics": _spreads(group, metrics, shared),
        "runs": [
            [int(row["seed"]), row["status"], row["reason"], *(_text(row[metric]) for metric in metrics[:_EACH])]
            for row in group[["seed", "status", "reason", *metrics[:_EACH]]].to_dict("records")
        ],
    }


def _spreads(group: "pd.DataFrame", metrics: Sequence[str], shared: Numbered) -> list[list[Any]]:
    """Return of each metric its title's number, and the median, the lowest and the highest of the runs with a value.

    Those of the table of cells come first.
    """
    names = [*metrics, *(column for column in metric_columns(group) if column not in metrics)]
    values = group[names].to_numpy(dtype=np.float64)
    known = [place for place in range(len(names)) if not np.isnan(values[:, place]).all()]
    with np.errstate(invalid="ignore"):
        spread = [function(values[:, known], axis=0) for function in (np.nanmedian, np.nanmin, np.nanmax)]
    titles = [_place(shared, quantity(names[place]).heading) for place in known]
    return [[title, *map(_text, numbers)] for title, *numbers in zip(titles, *spread, strict=True)]


def _text(value: float) -> str:
    return "" if math.isnan(value) else number(value)
