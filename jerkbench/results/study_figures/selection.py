"""The scenarios and methods that carry the findings of a study."""

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from jerkbench.report.analysis.comparison import Comparison
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.strongest import most_certain
from jerkbench.report.analysis.study_verdicts import study_verdicts

if TYPE_CHECKING:
    import pandas as pd

FINDINGS = 10
"""The strongest ones, as the report shows them first."""

SCENES = 3
"""Scenarios that are drawn at most: of each there are eight figures."""

METHODS = 4
"""Methods that are drawn in a scenario at most, beside the best."""

Methods = tuple[tuple[str, str], ...]
"""Filter and adaptation of each."""


def telling_scenes(rows: "pd.DataFrame", metric: str, names: Sequence[str]) -> dict[str, Methods]:
    """Return the scenarios in which a study's strongest findings are most certain, with the methods that they compare.

    Where there is no finding it is the first scenario, with the usual methods.

    Args:
        rows: one row a cell and seed.
        metric: the leading one.
        names: of the scenarios that can be drawn: data set, disturbance, attitude.
    """
    findings = most_certain(study_verdicts(rows, metric).standings)[:FINDINGS]
    scenes = {name: methods for name, methods in _scenes(findings).items() if name in names}
    return dict(list(scenes.items())[:SCENES]) or dict.fromkeys(names[:1], ())


def _scenes(findings: Iterable[Comparison]) -> Mapping[str, Methods]:
    """Return scenarios and their methods, the strongest first."""
    scenes: dict[str, Methods] = {}
    for pair in findings:
        for combination in (pair.baseline, pair.subject):
            label = dict(zip(FACTORS, combination, strict=True))
            name = ", ".join(label[factor] for factor in ("dataset", "disturbance", "attitude"))
            method = (label["filter"], label["adaptation"])
            scenes[name] = tuple(dict.fromkeys((*scenes.get(name, ()), method)))[:METHODS]
    return scenes
