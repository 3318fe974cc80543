"""Every cell of a study: a table to sort and to filter, with a word on how sure of itself each filter is."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from jerkbench.evaluation.statistics.intervals import up_to
from jerkbench.report.analysis.columns import FACTORS, quantity
from jerkbench.report.analysis.standings import Comparison
from jerkbench.report.analysis.study_verdicts import StudyVerdicts
from jerkbench.report.page.script_data import details
from jerkbench.report.tables.summary import summarise
from jerkbench.report.tables.table_model import Table, TableCell, factor_number, number

if TYPE_CHECKING:
    import pandas as pd

from typing import TYPE_CHECKING

import numpy as np

from jerkbench.evaluation.statistics.consistency import NEAR, UNKNOWN, runs_verdict
from jerkbench.evaluation.statistics.over_seeds import FEW
from jerkbench.report.analysis.columns import EXPECTED

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("velocity_rmse_mps", "outage_rmse_m", "lockout_s", "anees", "anis_per_row")
"""Metrics that get a column after the leading one, where they have values; a cell that is opened shows all."""


@dataclass(frozen=True)
class Value:
    """One entry of the table.

    Attributes:
        text: what is shown.
        interval: beside it, or nothing.
        sorting: the number to sort by, empty where there is none.
        extra: whether a narrow screen does without it.
    """

    text: str
    interval: str = ""
    sorting: str = ""
    extra: bool = False


@dataclass(frozen=True)
class Line:
    """One cell.

    Attributes:
        key: its key.
        labels: its factors that vary.
        values: its entries.
        verdict: what its NEES says.
        rule: "group" where another scenario begins, or nothing.
    """

    key: str
    labels: tuple[str, ...]
    values: tuple[Value, ...]
    verdict: str
    rule: str


@dataclass(frozen=True)
class Cells:
    """The table of every cell.

    Attributes:
        constants: what is the same in every cell, in a sentence.
        factors: those that vary.
        choices: their values, to filter by.
        heads: of the entries.
        lines: the cells.
        explanation: how to read a NEES's verdict.
        details: all of each cell, for the page's script.
    """

    constants: str
    factors: tuple[str, ...]
    choices: dict[str, list[str]]
    heads: tuple[str, ...]
    lines: list[Line]
    explanation: str
    details: dict[str, Any]


def cells_view(
    rows: "pd.DataFrame",
    keys: Sequence[str],
    about: Mapping[str, Mapping[str, Any]],
    metric: str,
    verdicts: StudyVerdicts,
) -> Cells:
    """Return the table of every cell.

    Args:
        rows: one row a cell and seed.
        keys: key of the cell of each row.
        about: what is stored beside each cell's rows, by key.
        metric: the leading metric.
        verdicts: of the study.
    """
    others = (column for column in COLUMNS if column != metric and column in rows and rows[column].notna().any())
    metrics = [metric, *others]
    cells = {column: by_combination(combinations(rows, column)) for column in metrics}
    ratios, by_key = _ratios(rows, verdicts), rows.assign(key=list(keys)).groupby("key", sort=False)
    groups = {str(key): group for key, group in by_key}
    factors = tuple(key for key in FACTORS if len(rows[key].unique()) > 1) or ("filter",)
    lines: list[Line] = []
    for scenario in _scenarios(groups.values()):
        for place, (key, combination) in enumerate(scenario):
            group = groups[key]
            values = _values(
                [cells[column][combination] for column in metrics], group, ratios and [ratios.get(combination)]
            )
            labels = tuple(str(group[factor].iloc[0]) for factor in factors)
            rule = "group" if lines and place == 0 else ""
            lines.append(Line(key, labels, values, nees_verdict(group), rule))
    against = ("times none",) if ratios else ()
    return Cells(
        constants=", ".join(f"{key} {rows[key].iloc[0]}" for key in FACTORS if key not in factors),
        factors=factors,
        choices={key: list(dict.fromkeys(rows[key].astype(str))) for key in factors},
        heads=(*(quantity(column).heading for column in metrics), *against, "lost runs"),
        lines=lines,
        explanation=nees_explanation(rows),
        details=details(groups, about, [column for column in metrics if column in rows]),
    )


def _scenarios(groups: "Iterable[pd.DataFrame]") -> list[list[tuple[str, tuple[str, ...]]]]:
    """Return the keys and combinations of the cells of each scenario."""
    scenarios: dict[tuple[str, ...], list[tuple[str, tuple[str, ...]]]] = {}
    for group in groups:
        combination = tuple(str(group[factor].iloc[0]) for factor in FACTORS)
        scenarios.setdefault(combination[:2], []).append((str(group["key"].iloc[0]), combination))
    return list(scenarios.values())


def combinations(rows: "pd.DataFrame", metric: str) -> Table:
    """Return the table in which each combination of the six factors has a row."""
    return summarise(rows, metric, row_keys=FACTORS[:-1], column_keys=FACTORS[-1:], leaders=False)


def by_combination(table: Table) -> dict[tuple[str, ...], TableCell]:
    """Return the cell of each combination of the six factors, of `combinations`."""
    return {tuple(labels[factor] for factor in FACTORS): cell for labels, cell in table.placed()}


def _ratios(rows: "pd.DataFrame", verdicts: StudyVerdicts) -> dict[tuple[str, ...], Comparison]:
    values = set(rows["adaptation"].astype(str))
    if "none" not in values or len(values) == 1:
        return {}
    return {comparison.subject: comparison for comparison in verdicts.against({"adaptation": "none"})}


def _values(
    cells: Sequence[TableCell], group: "pd.DataFrame", ratios: "Sequence[Comparison | None] | dict[Any, Any]"
) -> tuple[Value, ...]:
    lost = int((group["status"] != "ok").sum())
    bound = up_to(lost, len(group)) if (group["replicate"] == "seed").all() else ""
    return (
        *(_mean(cell, extra=place > 0) for place, cell in enumerate(cells)),
        *(_factor(comparison) for comparison in ratios),
        Value(f"{lost} of {len(group)}", bound, sorting=str(lost), extra=True),
    )


def _mean(cell: TableCell, *, extra: bool) -> Value:
    known = cell.number and not math.isnan(cell.mean)
    text = cell.number or cell.trouble
    sorting = "" if not known else "Infinity" if math.isinf(cell.mean) else f"{cell.mean:.7g}"
    return Value(text, cell.interval, sorting, extra)


def _factor(comparison: Comparison | None) -> Value:
    """The ratio to no adaptation, with its mark."""
    if comparison is None or not 0 < comparison.judgement.ratio < math.inf:
        return Value("", extra=True)
    value = comparison.judgement.ratio
    return Value(
        f"{factor_number(value) if comparison.shown else number(value)}{comparison.mark}",
        "",
        f"{value:.7g}",
        extra=True,
    )


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
    values = group.loc[well, ANEES].to_numpy(dtype=np.float64)
    return runs_verdict(values, CONSISTENT, lost=int((~well).sum()))
