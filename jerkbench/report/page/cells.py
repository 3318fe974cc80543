"""Every cell of a study: a table to sort and to filter, with a word on how sure of itself each filter is."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from jerkbench.evaluation.statistics.consistency import NEAR, UNKNOWN, runs_verdict
from jerkbench.evaluation.statistics.intervals import up_to
from jerkbench.evaluation.statistics.over_seeds import FEW
from jerkbench.report.analysis.columns import EXPECTED, FACTORS, Combination, quantity
from jerkbench.report.analysis.findings import study_baselines
from jerkbench.report.analysis.standings import Comparison
from jerkbench.report.analysis.study_verdicts import StudyVerdicts
from jerkbench.report.page.script_data import details
from jerkbench.report.tables.summary import summarise
from jerkbench.report.tables.table_model import TableCell

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("velocity_rmse_mps", "outage_rmse_m", "lockout_s", "anees", "anis_per_row")
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
    others = (column for column in COLUMNS if column != metric and column in rows and rows[column].notna().any())
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
CONSISTENT = EXPECTED[ANEES]


def nees_explanation(rows: "pd.DataFrame") -> str:
    """Return how to read the column; nothing where no cell has a value to judge."""
    if ANEES not in rows or rows[ANEES].isna().all():
        return ""
    low, high = (factor * CONSISTENT for factor in NEAR)
    return (
        f"{HEADING}: overconfident or too cautious where the whole interval of the ANEES over the seeds is above or "
        f"below {CONSISTENT:g}; consistent where it holds {CONSISTENT:g} and lies within {low:g} to {high:g}; not "
        f"known where it holds more than that, of one run and of phases. Of fewer than {FEW} seeds the interval is "
        "Student's on the logarithms. Where runs were lost the others can only be overconfident or not known."
    )


def nees_verdict(group: "pd.DataFrame") -> str:
    """Return the verdict on the rows of one cell; phases of one recording are no independent runs."""
    if ANEES not in group:
        return ""
    if (group["replicate"] == "phase").any():
        return UNKNOWN
    well = group["status"] == "ok"
    values = group.loc[well, ANEES].to_numpy(dtype=float)
    return runs_verdict(values, CONSISTENT, lost=int((~well).sum()))
