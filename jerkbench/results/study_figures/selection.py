"""The scenarios and methods that carry the findings of a study."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.strongest import largest
from jerkbench.report.analysis.study_verdicts import study_verdicts

if TYPE_CHECKING:
    import pandas as pd

NOTABLE = 0.5
"""A method is drawn where its difference is at least so large, as a part of the scenario's largest."""

SCENES = 3
"""Scenarios that are drawn at most: of each there are eight figures."""

METHODS = 4
"""Methods that are drawn in a scenario at most, beside the best."""

Methods = tuple[tuple[str, str], ...]
"""Filter and adaptation of each."""


def telling_scenes(scenes: Mapping[str, Methods]) -> dict[str, Methods]:
    """Return the first few of the scenarios `by_difference`; where none has a difference, the first of all."""
    told = [(name, methods) for name, methods in scenes.items() if methods]
    return dict(told[:SCENES] or list(scenes.items())[:1])


def by_difference(rows: "pd.DataFrame", metric: str, names: Sequence[str]) -> dict[str, Methods]:
    """Return all scenarios, the one with the largest certain difference first, each with the methods that differ.

    Methods whose difference is less than `NOTABLE` of the scenario's largest are left out. Scenarios without a
    difference come last, in their order, with no methods.

    Args:
        rows: one row a cell and seed.
        metric: the leading one.
        names: of the scenarios that can be drawn: data set, disturbance, attitude.
    """
    weights: dict[str, float] = {}
    scenes: dict[str, Methods] = {}
    for weight, pair in largest(study_verdicts(rows, metric).standings):
        for combination in (pair.baseline, pair.subject):
            label = dict(zip(FACTORS, combination, strict=True))
            name = ", ".join(label[factor] for factor in ("dataset", "disturbance", "attitude"))
            if name in names and weight >= NOTABLE * weights.setdefault(name, weight):
                method = (label["filter"], label["adaptation"])
                scenes[name] = tuple(dict.fromkeys((*scenes.get(name, ()), method)))[:METHODS]
    return {**scenes, **{name: () for name in names if name not in scenes}}
