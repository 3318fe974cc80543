"""The part of the report with every cell: a table to sort and to filter, and each cell's configuration behind it."""

import json
import math
from collections.abc import Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from jerkbench.report.analysis.comparison import Comparison, compare_to
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.rows import metric_columns
from jerkbench.report.page import nees
from jerkbench.report.tables.summary import summarise
from jerkbench.report.tables.table_model import Cell, Table, factor_number, number

if TYPE_CHECKING:
    import pandas as pd

COLUMNS = ("velocity_rmse_mps", "outage_rmse_m", "outage_end_m", "lockout_s", "anees", "anis_per_row")
"""Metrics that get a column after the leading one, where they have values."""


def cells_section(
    rows: "pd.DataFrame", keys: Sequence[str], about: Mapping[str, Mapping[str, Any]], metric: str
) -> str:
    """Return the filters, the table and a template for each cell.

    Args:
        rows: one row a cell and seed.
        keys: key of the cell of each row.
        about: what is stored beside each cell's rows, by key.
        metric: the leading metric.
    """
    metrics = [metric, *(one for one in COLUMNS if one != metric and one in rows and rows[one].notna().any())]
    tables = {one: combinations(rows, one) for one in metrics}
    found = {one: by_combination(table) for one, table in tables.items()}
    ratios = _ratios(rows, metric)
    groups = rows.assign(key=list(keys)).groupby("key", sort=False)
    lines, templates = [], []
    for key, group in groups:
        combination = tuple(str(group[one].iloc[0]) for one in FACTORS)
        cells = [found[one][combination] for one in metrics]
        lines.append(_line(str(key), combination, cells, ratios.get(combination), group))
        templates.append(_template(str(key), combination, group, about[str(key)]))
    heads = [*FACTORS, *(tables[one].title for one in metrics), "×  none", nees.HEADING, "lost", "runs"]  # noqa: RUF001
    varying = [len(rows[key].unique()) > 1 for key in FACTORS]
    constant = [f":nth-child({k + 1})" for k, one in enumerate(varying) if not one]
    hidden = f"#cells :is(th, td):is({', '.join(constant)}) {{ display: none; }}" if constant else ""
    head = "".join(f'<th scope="col"><button>{escape(text)}</button></th>' for text in heads)
    return (
        f"<style>{hidden}</style>{_same(rows, varying)}{_muted(nees.explanation(rows))}{_filters(rows)}"
        f'<div class="scroll"><table id="cells"><thead><tr>{head}<th></th></tr></thead>\n<tbody>\n'
        + "\n".join(lines)
        + '\n</tbody></table></div>\n<dialog id="cell"><form method="dialog"><button>Close</button></form>'
        + '<div id="content"></div></dialog>\n'
        + "\n".join(templates)
    )


def _same(rows: "pd.DataFrame", varying: Sequence[bool]) -> str:
    """What needs no column."""
    constant = [f"{key} {rows[key].iloc[0]}" for key, one in zip(FACTORS, varying, strict=True) if not one]
    return _muted(f"In every cell: {', '.join(constant)}." if constant else "")


def _muted(text: str) -> str:
    return f'<p class="muted">{escape(text)}</p>' if text else ""


def combinations(rows: "pd.DataFrame", metric: str) -> Table:
    """Return the table in which each combination of the six factors has a row."""
    return summarise(rows, metric, row_keys=FACTORS[:-1], column_keys=FACTORS[-1:])


def by_combination(table: Table) -> dict[tuple[str, ...], Cell]:
    """Return the cell of each combination of the six factors, of `combinations`."""
    return {
        (*row, *column): cell
        for row, line in zip(table.rows, table.cells, strict=True)
        for column, cell in zip(table.columns, line, strict=True)
        if cell is not None
    }


def _ratios(rows: "pd.DataFrame", metric: str) -> dict[tuple[str, ...], Comparison]:
    if "none" not in set(rows["adaptation"].astype(str)):
        return {}
    return {one.subject: one for one in compare_to(rows, metric, {"adaptation": "none"})}


def _line(
    key: str, combination: tuple[str, ...], cells: Sequence[Cell], ratio: Comparison | None, group: "pd.DataFrame"
) -> str:
    texts = "".join(f"<td>{escape(text)}</td>" for text in combination)
    numbers = "".join(_mean(cell) for cell in cells)
    lost = int((group["status"] != "ok").sum())
    against = _factor(ratio)
    end = f"{_number(lost)}{_number(len(group))}"
    button = f'<td><button data-key="{escape(key)}">open</button></td>'
    return f"<tr>{texts}{numbers}{against}<td>{nees.says(group)}</td>{end}{button}</tr>"


def _mean(cell: Cell) -> str:
    if not math.isfinite(cell.mean):
        return f'<td class="number" data-value="">{escape(cell.text)}</td>'
    interval = f' <span class="interval">{escape(cell.interval)}</span>' if cell.interval else ""
    return f'<td class="number" data-value="{cell.mean!r}">{escape(cell.number)}{interval}</td>'


def _number(value: float) -> str:
    if not math.isfinite(value):
        return '<td class="number" data-value=""></td>'
    return f'<td class="number" data-value="{value!r}">{number(value) if value % 1 else int(value)}</td>'


def _factor(one: Comparison | None) -> str:
    """The ratio to no adaptation, with its mark."""
    if one is None or not 0 < one.judgement.ratio < math.inf:
        return _number(math.nan)
    value = one.judgement.ratio
    text = f"{factor_number(value) if one.shown else number(value)}{one.mark}"
    return f'<td class="number" data-value="{value!r}">{text}</td>'


def _filters(rows: "pd.DataFrame") -> str:
    selects = []
    for place, key in enumerate(FACTORS):
        values = list(dict.fromkeys(rows[key].astype(str)))
        if len(values) > 1:
            options = "".join(f"<option>{escape(value)}</option>" for value in values)
            selects.append(
                f'<label>{key} <select data-column="{place}"><option value="">all</option>{options}</select></label>'
            )
    words = '<label>words <input id="words" type="search" placeholder="jerk outage"></label>'
    return f'<div class="filters">{words}{"".join(selects)}<span id="shown"></span></div>\n'


def _value(value: object) -> str:
    if not isinstance(value, float):
        return str(value)
    return "" if math.isnan(value) else number(value)


def _template(key: str, combination: tuple[str, ...], group: "pd.DataFrame", about: Mapping[str, Any]) -> str:
    columns = ["seed", "status", "reason", *metric_columns(group)]
    values = group[[one for one in columns if group[one].notna().any()]]
    head = "".join(f"<th>{escape(str(one))}</th>" for one in values.columns)
    lines = "".join(
        f"<tr>{''.join(f'<td>{escape(_value(value))}</td>' for value in line)}</tr>"
        for line in values.itertuples(index=False)
    )
    told = {
        one: about[one] for one in ("spec", "protocol", "data", "notes", "created", "seconds", "commit", "versions")
    }
    key = escape(key)
    again = f"cells/{key}.parquet; once more: jerkbench rerun FOLDER {key}"
    return (
        f'<template id="cell-{key}"><h3>{escape(", ".join(combination))}</h3><p class="muted">{again}</p>'
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{lines}</tbody></table></div>'
        f"<pre>{escape(json.dumps(told, indent=1, ensure_ascii=False))}</pre></template>"
    )
