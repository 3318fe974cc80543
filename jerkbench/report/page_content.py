"""The content of a report: matrix of error ratios, parameters of the methods, combinations, and errors over time."""

import base64
import gzip
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.evaluated_run import Combination
from jerkbench.evaluation.intervals import failures_text, up_to
from jerkbench.evaluation.judgement import WINS, Verdict
from jerkbench.report.columns import FACTORS, metric_columns, quantity, varying_factors, with_metric
from jerkbench.report.comparisons import Comparison, Standing
from jerkbench.report.findings import against, mean_log_ratio, reference_method, size_text, study_baselines
from jerkbench.report.labels import METHOD_PARTS
from jerkbench.report.study_verdicts import StudyVerdicts
from jerkbench.report.table_model import arranged, number

if TYPE_CHECKING:
    import pandas as pd


MAX_FINDINGS = 10
"""Maximum number of visible findings. Further findings are folded."""


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
    texts = {
        method: [f"{name} {' or '.join(list(of)[:MAX_FINDINGS])}" for name, of in seen.items()]
        for method, seen in values.items()
    }
    return [(method, ", ".join(parameters) or "none") for method, parameters in texts.items()]


# The matrix of a study: the error of each method in each scenario, relative to a reference method.

SHADES = (1.1, 1.5)
"""Ratios from which on a significant difference gets the second and the third shade of its colour."""

MANY_SCENARIOS = 8
"""If a study has more scenarios than this, and more scenarios than methods, the rows of the matrix are scenarios."""


def matrix(standings: Sequence[Standing]) -> dict[str, Any] | None:
    """Return the matrix of error ratios of a study, or None if no comparison was tested.

    The matrix has a row for each method and a column for each scenario. If there are many scenarios, the matrix is
    transposed.
    """
    tested = [standing for standing in standings if standing.tested]
    if not tested:
        return None
    reference = reference_method(tested)
    names = list(dict.fromkeys(standing.name(rival) for standing in tested for rival in standing.rivals))
    scenarios = [", ".join(standing.scenario) or "the scenario" for standing in tested]
    seen = [against(standing, reference) for standing in tested]
    names.sort(key=lambda name: mean_log_ratio(seen, name))
    rows = [[_matrix_cell(standing, seen[k], name, reference) for k, standing in enumerate(tested)] for name in names]
    corner, columns, labels = "method", scenarios, names
    if len(scenarios) > MANY_SCENARIOS and len(scenarios) > len(names):
        corner, columns, labels, rows = "scenario", names, scenarios, [list(cells) for cells in zip(*rows, strict=True)]
    lines = list(zip(labels, rows, strict=True))
    return {"reference": reference, "corner": corner, "columns": columns, "lines": lines}


def _matrix_cell(
    standing: Standing, seen: Mapping[str, Comparison], name: str, reference: str
) -> dict[str, str | bool]:
    """Return the content of a cell: text (the ratio), style, hint about the comparison, and number of failed runs.

    The style of a cell is better1 to better3, worse1 to worse3, equal, undecided, reference or absent. The entry
    "leads" is True if the method is one of the best in the scenario.
    """
    cell: dict[str, str | bool] = {"leads": standing.decided and name in standing.leaders, "hint": "", "failed": ""}
    if name == reference and any(standing.name(rival) == name for rival in standing.rivals):
        return cell | {"text": "1", "style": "reference", "hint": "the reference"}
    if name not in seen:
        return cell | {"text": "-", "style": "absent"}
    pair, judgement = seen[name], seen[name].judgement
    style, hint = "undecided" if pair.verdict is Verdict.UNDECIDED else "equal", pair.verdict.value
    if pair.shown:
        factor = max(judgement.ratio, 1 / judgement.ratio) if 0 < judgement.ratio < math.inf else math.inf
        direction = "better" if pair.verdict in WINS else "worse"
        style, hint = f"{direction}{1 + sum(factor >= step for step in SHADES)}", size_text(judgement)
    if 0 < judgement.low <= judgement.high < math.inf:
        hint += f"; ratio 95 % {number(judgement.low)} to {number(judgement.high)}"
    counts = judgement.failed[0], judgement.outlying[0]
    failed = failures_text(*counts, judgement.n, bound=False) if any(counts) else ""
    text = pair.ratio_text or ("failed" if judgement.ratio else "succeeds")
    return cell | {"text": text, "style": style, "hint": hint, "failed": failed}


# The table of all combinations. In the page, it can be sorted and filtered.


_COLUMNS = ("velocity_rmse_mps", "outage_rmse_m", "lockout_s", "anees", "anis_per_row")
"""Metrics that get a column after the main metric if they have values. The details of a combination list all."""


def cells_view(
    rows: "pd.DataFrame",
    keys: Sequence[str],
    about: Mapping[str, Mapping[str, Any]],
    metric: str,
    verdicts: StudyVerdicts,
) -> dict[str, Any]:
    """Return the variables of the template that renders the table of all combinations.

    Args:
        rows: one row for each job and seed.
        keys: for each row, the key of its job.
        about: metadata of each job, by the key of the job.
        metric: main metric of the study.
        verdicts: verdicts of the study for this metric.
    """
    others = (column for column in _COLUMNS if column != metric and column in rows and rows[column].notna().any())
    metrics = [metric, *others]
    grid = arranged(with_metric(rows, metric), FACTORS[:-1], FACTORS[-1:])
    cells = [grid.cells(name) for name in metrics]
    baselines = study_baselines(rows, ["adaptation"])
    ratios = {comparison.subject: comparison for of in baselines for comparison in verdicts.against(of)}
    groups = {str(key): group for key, group in rows.assign(key=list(keys)).groupby("key", sort=False)}
    factors = varying_factors(rows) or ("filter",)
    lines = []
    for key, group in groups.items():
        combination = Combination(*(str(group[factor].iloc[0]) for factor in FACTORS))
        failed = int((group["status"] != "ok").sum())
        line = {
            "key": key,
            "labels": [getattr(combination, factor) for factor in factors],
            "cells": [of[combination] for of in cells],
            "ratio": ratios.get(combination),
            "failed": failed,
            "runs": len(group),
            "bound": up_to(failed, len(group)) if (group["replicate"] == "seed").all() else "",
        }
        lines.append(line)
    return {
        "constants": ", ".join(f"{key} {rows[key].iloc[0]}" for key in FACTORS if key not in factors),
        "factors": factors,
        "choices": {key: list(dict.fromkeys(rows[key].astype(str))) for key in factors},
        "heads": (*(quantity(column).heading for column in metrics), *["times none"] * bool(ratios), "failed runs"),
        "with_ratios": bool(ratios),
        "lines": lines,
        "details": details(groups, about, [column for column in metrics if column in rows]),
    }


# Data for the script of the page: errors over time (two bytes for each error), and details of combinations.

LOWEST, MAX_AXIS_M = 1e-9, 1e9
"""Range of the encoded errors [m]. Errors outside this range are clipped."""

LEVELS = 65534
"""Number of steps of the encoded logarithm. The errors of adjacent steps differ by 0.06 %."""

ERROR_SCALE = {"lowest": LOWEST, "decades": math.log10(MAX_AXIS_M / LOWEST), "levels": LEVELS}
"""The scale of the encoded errors, from which the script of the page decodes them."""


def largest_of_steps(t_s: FloatArray, error_m: FloatArray, edges_s: FloatArray) -> FloatArray:
    """Return the largest of all errors that fall into each time step.

    Args:
        t_s: (k,) times of the errors [s].
        error_m: (k,) errors [m], or NaN for unknown errors.
        edges_s: (n + 1,) start of each of the n time steps, and end of the last time step [s].

    Returns:
        (n,) largest error in each time step [m], or NaN for a time step without a known error.
    """
    known = np.isfinite(error_m)
    index = np.clip(np.searchsorted(edges_s, t_s[known], side="right") - 1, 0, len(edges_s) - 2)
    largest = np.full(len(edges_s) - 1, -np.inf)
    np.maximum.at(largest, index, error_m[known])
    return np.where(np.isinf(largest), np.nan, largest)


def encoded(error_m: FloatArray) -> str:
    """Return errors [m] as base64 text for the script of the page.

    The logarithms of the errors are encoded as integers from 1 to 65535, and NaN as 0.
    """
    span = np.log10(MAX_AXIS_M / LOWEST)
    with np.errstate(invalid="ignore"):
        share = np.log10(np.clip(error_m, LOWEST, MAX_AXIS_M) / LOWEST) / span
    steps = np.where(np.isnan(share), 0, 1 + np.round(np.nan_to_num(share) * LEVELS))
    return base64.b64encode(steps.astype("<u2").tobytes()).decode()


_RECORD = ("spec", "protocol", "data", "notes", "created", "seconds", "commit", "versions")
"""Metadata of a job that are displayed in its details."""

_EACH = 3
"""Maximum number of metrics whose values are listed for each run."""


def details(
    groups: "Mapping[str, pd.DataFrame]", about: Mapping[str, Mapping[str, Any]], metrics: Sequence[str]
) -> dict[str, Any]:
    """Return the details of each job. The script of the page displays the details when the user requests them.

    Args:
        groups: rows of each job, by the key of the job.
        about: metadata of each job, by the key of the job.
        metrics: metrics of the table, starting with the main metric.
    """
    cells = {key: _details_of(group, about[key], metrics) for key, group in groups.items()}
    return {"seeds": [quantity(column).heading for column in metrics[:_EACH]], "cells": cells}


def _details_of(group: "pd.DataFrame", about: Mapping[str, Any], metrics: Sequence[str]) -> dict[str, Any]:
    names = [*metrics, *(column for column in metric_columns(group) if column not in metrics)]
    spread = group[names].dropna(axis=1, how="all").agg(["median", "min", "max"])
    return {
        "labels": [[factor, str(about["labels"][factor])] for factor in FACTORS],
        "record": {name: about[name] for name in _RECORD},
        "metrics": [[quantity(str(name)).heading, *map(_text, spread[name])] for name in spread],
        "runs": [
            [int(row["seed"]), row["status"], row["reason"], *(_text(row[metric]) for metric in metrics[:_EACH])]
            for row in group.to_dict("records")
        ],
    }


def packed_json(content: Mapping[str, Any]) -> str:
    """Return ``content`` as JSON, compressed by gzip and encoded as base64."""
    text = json.dumps(content, separators=(",", ":"))
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()


def _text(value: float) -> str:
    return "" if math.isnan(value) else number(value)
