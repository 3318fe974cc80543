"""The first screen of a report: the answer in a sentence, who leads where, the findings."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from jerkbench.evaluation.statistics.judgement import Verdict
from jerkbench.report.analysis.answer import answer, round_of
from jerkbench.report.analysis.columns import FACTORS
from jerkbench.report.analysis.findings import compared, sentence, strongest, varying_factors
from jerkbench.report.analysis.runs import Combination
from jerkbench.report.analysis.standings import Comparison, Standing, verdict_sentences
from jerkbench.report.analysis.study_verdicts import StudyVerdicts, across
from jerkbench.report.tables.table_model import TableCell

if TYPE_CHECKING:
    import pandas as pd

SCENARIO = ("dataset", "disturbance", "attitude")

NAMED = 4
"""So many leaders are named."""

MOST = 10
"""So many findings are read; the others are behind a fold."""


@dataclass(frozen=True)
class Lead:
    """The leading group of a scenario.

    Attributes:
        scenario: its name.
        names: of the leaders, the lowest error first; empty where nobody leads.
        more: how many further leaders there are.
        rivals: how many methods there are.
        cell: of the first leader.
        against: how the first leader compares with the baseline; empty where there is none.
    """

    scenario: str
    names: tuple[str, ...]
    more: int
    rivals: int
    cell: TableCell | None
    against: str


@dataclass(frozen=True)
class FirstScreen:
    """What a reader sees first.

    Attributes:
        answer: of the study, in one sentence.
        summary: who leads how often, how many pairs of methods are what.
        leads: one a scenario.
        baseline: whether any of them is held against the baseline.
        findings: sentences by size and certainty.
        more: further ones.
        across: sentences about all scenarios together.
        every: heading and sentences of each scenario's comparisons with the baselines.
    """

    answer: str
    summary: list[str]
    leads: list[Lead]
    baseline: bool
    findings: list[str]
    more: list[str]
    across: list[str]
    every: list[tuple[str, list[str]]]


def first_screen(
    rows: "pd.DataFrame",
    verdicts: StudyVerdicts,
    metric: str,
    cells: Mapping[Combination, TableCell],
) -> FirstScreen:
    """Return what a reader sees first.

    Args:
        rows: one row a cell and seed.
        verdicts: of the study, in the leading metric.
        metric: that.
        cells: of each combination.
    """
    standings = verdicts.standings
    leads = [_lead(standing, cells) for standing in standings if standing.contest.comparisons]
    findings = strongest(standings)
    every = _every(compared(rows, verdicts), varying_factors(rows))
    return FirstScreen(
        answer=answer(standings),
        summary=verdict_sentences(standings),
        leads=leads,
        baseline=any(lead.against for lead in leads),
        findings=findings[:MOST],
        more=findings[MOST:],
        across=across(rows, verdicts, metric),
        every=every,
    )


def _lead(standing: Standing, cells: Mapping[Combination, TableCell]) -> Lead:
    contest = standing.contest
    leaders = sorted(contest.leaders, key=lambda key: _size(cells.get(key))) if contest.decided else []
    return Lead(
        scenario=", ".join(standing.scenario) or "the only one",
        names=tuple(map(standing.name, leaders[:NAMED])),
        more=max(0, len(leaders) - NAMED),
        rivals=len(contest.rivals),
        cell=cells.get(leaders[0]) if leaders else None,
        against=_against_baseline(contest.comparisons, leaders[0]) if leaders else "",
    )


def _size(cell: TableCell | None) -> float:
    return math.inf if cell is None or math.isnan(cell.mean) else cell.mean


def _against_baseline(comparisons: Sequence[Comparison], leader: Combination) -> str:
    """Say how a leader compares with the baseline without adaptation, where that is a rival."""
    for pair in comparisons:
        for ours, theirs in ((pair.subject, pair.baseline), (pair.baseline, pair.subject)):
            if ours == leader and theirs[3:5] == ("baseline", "none"):
                seen = round_of(pair) if ours == pair.subject else round_of(pair).turned
                shown = seen.verdict not in {Verdict.EQUAL, Verdict.UNDECIDED}
                return f"{seen.words if shown else seen.verdict.value}; {seen.judgement.losses}"
    return "is the baseline" if leader[3:5] == ("baseline", "none") else ""


def _every(comparisons: Sequence[Comparison], varying: Sequence[str]) -> list[tuple[str, list[str]]]:
    """Return every comparison in a sentence, scenario by scenario."""
    shown = [key for key in SCENARIO if key in varying]
    scenes: dict[str, list[Comparison]] = {}
    for comparison in comparisons:
        values = dict(zip(FACTORS, comparison.subject, strict=True))
        scenes.setdefault(", ".join(values[key] for key in shown), []).append(comparison)
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
