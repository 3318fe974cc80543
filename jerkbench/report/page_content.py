"""The content of a report: matrix of error ratios, parameters of the methods, and errors over time."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.evaluation.intervals import failures_text
from jerkbench.evaluation.judgement import WINS, Verdict
from jerkbench.report.comparisons import Comparison, Standing
from jerkbench.report.findings import against, mean_log_ratio, reference_method
from jerkbench.report.labels import METHOD_PARTS
from jerkbench.report.table_model import number

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


def matrix(standings: Sequence[Standing]) -> dict[str, Any] | None:
    """Return the matrix of error ratios of a study, or None if no comparison was tested.

    The matrix has a row for each method and a column for each scenario.
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


# Data for the script of the page: errors over time.


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
