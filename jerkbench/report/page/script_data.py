"""What the page's script reads: errors over time, two bytes each, and all that is known of each cell."""

import base64
import gzip
import json
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.report.analysis.columns import FACTORS, metric_columns, quantity
from jerkbench.report.tables.table_model import number

if TYPE_CHECKING:
    import pandas as pd

LOWEST, HIGHEST = 1e-9, 1e9
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
    span = np.log10(HIGHEST / LOWEST)
    with np.errstate(invalid="ignore"):
        share = np.log10(np.clip(error_m, LOWEST, HIGHEST) / LOWEST) / span
    steps = np.where(np.isnan(share), 0, 1 + np.round(np.nan_to_num(share) * LEVELS))
    return base64.b64encode(steps.astype("<u2").tobytes()).decode()


def payload(stretches: Sequence[Stretch], styles: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
    """Return what the page's script reads.

    Args:
        stretches: of each scenario.
        styles: colour and dashes of each cell's line, by key.
        names: of each cell's method, by key.
    """
    return {
        "lowest": LOWEST,
        "decades": float(np.log10(HIGHEST / LOWEST)),
        "levels": LEVELS,
        "scenarios": [_told(stretch, styles, names) for stretch in stretches if stretch.errors_m],
    }


def _told(stretch: Stretch, styles: Mapping[str, Any], names: Mapping[str, str]) -> dict[str, Any]:
    lines = [
        {"key": key, "name": names[key], **styles[key], "error": encoded(error)}
        for key, error in stretch.errors_m.items()
    ]
    outages = np.round(stretch.outages_s, 3).tolist()
    place = {"start": round(stretch.start_s, 6), "step": round(stretch.step_s, 6)}
    return {"name": stretch.scenario, "draw": stretch.draw, **place, "outages": outages, "lines": lines}


TOLD = ("protocol", "data", "notes", "created", "seconds", "commit", "versions")
"""What of a cell's record is told beside its configuration."""


EACH = 3
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
    seeds = [quantity(column).heading for column in metrics[:EACH]]
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
        "told": {name: _place(shared, about[name]) for name in TOLD},
        "metrics": _spreads(group, metrics, shared),
        "runs": [
            [int(row["seed"]), row["status"], row["reason"], *(_text(row[metric]) for metric in metrics[:EACH])]
            for row in group[["seed", "status", "reason", *metrics[:EACH]]].to_dict("records")
        ],
    }


def _spreads(group: "pd.DataFrame", metrics: Sequence[str], shared: Numbered) -> list[list[Any]]:
    """Return of each metric its title's number, and the median, the lowest and the highest of the runs with a value.

    Those of the table of cells come first.
    """
    rest = [column for column in metric_columns(group) if column not in metrics]
    names = [*metrics, *rest]
    values = group[names].to_numpy(dtype=np.float64)
    known = [place for place in range(len(names)) if not np.isnan(values[:, place]).all()]
    with np.errstate(invalid="ignore"):
        spread = [function(values[:, known], axis=0) for function in (np.nanmedian, np.nanmin, np.nanmax)]
    titles = [_place(shared, quantity(names[place]).heading) for place in known]
    return [[title, *map(_text, numbers)] for title, *numbers in zip(titles, *spread, strict=True)]


def _text(value: float) -> str:
    return "" if math.isnan(value) else number(value)
