"""All that is known of each cell, as the page's script reads it; what several cells share stands there once."""

import base64
import gzip
import json
import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.analysis.rows import metric_columns
from jerkbench.report.tables.table_model import number

if TYPE_CHECKING:
    import pandas as pd

TOLD = ("protocol", "data", "notes", "created", "seconds", "commit", "versions")
"""What of a cell's record is told beside its configuration."""


EACH = 3
"""So many metrics are told of each run, the first ones; of the others the spread."""


class Shared:
    """Values that stand once, each with a number."""

    def __init__(self) -> None:
        """Begin with none."""
        self.items: list[Any] = []
        self._places: dict[str, int] = {}

    def place(self, value: object) -> int:
        """Return the number of ``value``; the same for an equal one."""
        text = json.dumps(value, sort_keys=True)
        if text not in self._places:
            self._places[text] = len(self.items)
            self.items.append(value)
        return self._places[text]


def details(
    groups: "Mapping[str, pd.DataFrame]", about: Mapping[str, Mapping[str, Any]], metrics: Sequence[str]
) -> dict[str, Any]:
    """Return what the page's script shows of a cell that is opened.

    Args:
        groups: rows of each cell, by its key.
        about: what is stored beside them.
        metrics: those of the table, the leading one first.
    """
    shared = Shared()
    cells = {key: _cell(group, about[key], metrics, shared) for key, group in groups.items()}
    return {"shared": shared.items, "seeds": [quantity(column).heading for column in metrics[:EACH]], "cells": cells}


def packed(content: Mapping[str, Any]) -> str:
    """Return ``content`` as JSON, by gzip and base64: a fifth as long."""
    text = json.dumps(content, separators=(",", ":"))
    return base64.b64encode(gzip.compress(text.encode(), mtime=0)).decode()


def _cell(group: "pd.DataFrame", about: Mapping[str, Any], metrics: Sequence[str], shared: Shared) -> dict[str, Any]:
    return {
        "labels": [[factor, str(about["labels"][factor])] for factor in FACTORS],
        "spec": {kind: shared.place(part) for kind, part in about["spec"].items()},
        "told": {name: shared.place(about[name]) for name in TOLD},
        "metrics": _spreads(group, metrics, shared),
        "runs": [
            [int(row["seed"]), row["status"], row["reason"], *(_text(row[metric]) for metric in metrics[:EACH])]
            for row in group[["seed", "status", "reason", *metrics[:EACH]]].to_dict("records")
        ],
    }


def _spreads(group: "pd.DataFrame", metrics: Sequence[str], shared: Shared) -> list[list[Any]]:
    """Return of each metric its title's number, and the median, the lowest and the highest of the runs with a value.

    Those of the table of cells come first.
    """
    rest = [column for column in metric_columns(group) if column not in metrics]
    names = [*metrics, *rest]
    values = group[names].to_numpy(dtype=np.float64)
    known = [place for place in range(len(names)) if not np.isnan(values[:, place]).all()]
    with np.errstate(invalid="ignore"):
        spread = [function(values[:, known], axis=0) for function in (np.nanmedian, np.nanmin, np.nanmax)]
    titles = [shared.place(quantity(names[place]).heading) for place in known]
    return [[title, *map(_text, numbers)] for title, *numbers in zip(titles, *spread, strict=True)]


def _text(value: float) -> str:
    return "" if math.isnan(value) else number(value)
