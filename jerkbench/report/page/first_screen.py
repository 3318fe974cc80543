"""The first screen of a report: the answer, methods x scenarios in one picture, settings, the findings."""

import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from jerkbench.report.analysis.answer import Answer, answer
from jerkbench.report.analysis.findings import compared, sentence, strongest, varying_factors
from jerkbench.report.analysis.standings import Comparison, verdict_sentences
from jerkbench.report.analysis.study_verdicts import StudyVerdicts, across
from jerkbench.report.page.matrix import Matrix, matrix
from jerkbench.report.tables.table_model import number

if TYPE_CHECKING:
    import pandas as pd

SCENARIO = ("dataset", "disturbance", "attitude")

MOST = 10
"""So many findings are read; the others are behind a fold."""

PARTS = ("filter", "adaptation")
"""Parts of a method; the noise is among the parameters of the filter."""


@dataclass(frozen=True)
class Settings:
    """The parameters of one method in a study.

    Attributes:
        method: filter and adaptation.
        tried: how many settings it ran with in a scenario, the most.
        parameters: each with its value, or with its values where there are several.
    """

    method: str
    tried: int
    parameters: str


@dataclass(frozen=True)
class FirstScreen:
    """What a reader sees first.

    Attributes:
        answer: who won and by how much, and what that rests on.
        matrix: methods x scenarios; None where nothing was compared.
        settings: values of each method's parameters.
        summary: who leads how often, how many pairs of methods are what.
        findings: sentences by size and certainty.
        more: further ones.
        across: sentences about all scenarios together.
        every: heading and sentences of each scenario's comparisons with the baselines.
    """

    answer: Answer
    matrix: Matrix | None
    settings: list[Settings]
    summary: list[str]
    findings: list[str]
    more: list[str]
    across: list[str]
    every: list[tuple[str, list[str]]]


def first_screen(
    rows: "pd.DataFrame", verdicts: StudyVerdicts, metric: str, about: Mapping[str, Mapping[str, Any]]
) -> FirstScreen:
    """Return what a reader sees first.

    Args:
        rows: one row a cell and seed.
        verdicts: of the study, in the leading metric.
        metric: that.
        about: what is stored beside each cell's rows, by key.
    """
    standings = verdicts.standings
    findings = strongest(standings)
    return FirstScreen(
        answer=answer(standings),
        matrix=matrix(standings),
        settings=settings(about.values()),
        summary=verdict_sentences(standings),
        findings=findings[:MOST],
        more=findings[MOST:],
        across=across(rows, verdicts, metric),
        every=_every(compared(rows, verdicts), varying_factors(rows)),
    )


def settings(about: Iterable[Mapping[str, Any]]) -> list[Settings]:
    """Return each method's parameters, of the filter and the adaptation."""
    values: dict[str, dict[str, dict[str, None]]] = {}
    tried: dict[str, dict[tuple[str, str], set[str]]] = {}
    for cell in about:
        spec, labels = cell["spec"], cell["labels"]
        method = " + ".join(str(labels[factor]) for factor in ("filter", "adaptation"))
        own = {f"{kind}.{name}": value for kind in PARTS for name, value in spec[kind].items() if name != "name"}
        for name, value in own.items():
            values.setdefault(method, {}).setdefault(name, {})[_short(value)] = None
        scenario = (str(labels["dataset"]), str(labels["disturbance"]))
        tried.setdefault(method, {}).setdefault(scenario, set()).add(json.dumps(own, sort_keys=True, default=str))
    return [
        Settings(
            method,
            max(map(len, tried[method].values())),
            ", ".join(f"{name} {' or '.join(list(of)[:MOST])}" for name, of in values.get(method, {}).items())
            or "none",
        )
        for method in tried
    ]


def _short(value: object) -> str:
    return number(value) if isinstance(value, float) else str(value)


def _every(comparisons: Sequence[Comparison], varying: Sequence[str]) -> list[tuple[str, list[str]]]:
    """Return every comparison in a sentence, scenario by scenario."""
    shown = [key for key in SCENARIO if key in varying]
    scenes: dict[str, list[Comparison]] = {}
    for comparison in comparisons:
        scenes.setdefault(", ".join(getattr(comparison.subject, key) for key in shown), []).append(comparison)
    return [(_counted(name, of_scene), _ordered(of_scene, varying)) for name, of_scene in scenes.items()]


def _counted(name: str, comparisons: Sequence[Comparison]) -> str:
    where = f"{name}: " if name else ""
    if all(math.isnan(comparison.judgement.p) for comparison in comparisons):
        return f"{where}{len(comparisons)} comparisons, without a test (no seeds)"
    counts = Counter(comparison.verdict.value for comparison in comparisons)
    return f"{where}{len(comparisons)} comparisons: {', '.join(f'{count} {word}' for word, count in counts.items())}"


def _ordered(comparisons: Sequence[Comparison], varying: Sequence[str]) -> list[str]:
    """Those that were shown first."""
    return [
        sentence(comparison, varying) for comparison in sorted(comparisons, key=lambda comparison: not comparison.shown)
    ]
