"""The part of the report that a reader sees first: what is best where, the paper's claim, and what differs."""

import math
from collections import Counter
from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

from jerkbench.report.analysis.comparison import Combination, Comparison
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.findings import compared, names, sentence, varying_factors
from jerkbench.report.analysis.paper_claim import (
    CLAIMED,
    FAILS,
    HOLDS,
    OPEN,
    better,
    claim_sentences,
    claimed,
    headlines,
    verdicts,
)
from jerkbench.report.analysis.standings import Standing, standings, summary
from jerkbench.report.page.text import bullets, fold, grid, small
from jerkbench.report.tables.table_model import Cell, number

if TYPE_CHECKING:
    import pandas as pd

SCENARIO = ("dataset", "disturbance", "attitude")

NOTE = (
    "Leaders: the methods that no other was shown to beat, all pairs of all scenarios as one family. What is told the "
    "true R (oracle) and what has no sensor but GNSS (gnss_only) are references and compete with nobody. The factor is "
    "that of the first leader against the baseline without adaptation."
)

LEADERS = 4
"""So many leaders are named."""

CLASSES = {HOLDS: "passed", FAILS: "failed", OPEN: "open"}


def findings_section(rows: "pd.DataFrame", metric: str, title: str, cells: dict[Combination, Cell]) -> str:
    """Return the leaders of each scenario, the claim, and every comparison in sentences.

    Args:
        rows: one row a cell and seed.
        metric: the leading metric.
        title: its name with the unit.
        cells: its mean for each combination.
    """
    found = compared(rows, metric)
    standing = standings(rows, metric)
    parts = [_leaders(standing, cells, title), _claim(rows), _sentences(found, varying_factors(rows))]
    return "".join(parts) or bullets(["Nothing can be compared."])


def _leaders(found: Sequence[Standing], cells: dict[Combination, Cell], title: str) -> str:
    """Who leads how often, and a line for each scenario."""
    if not any(one.contest.comparisons for one in found):
        return ""
    lines = [
        [escape(", ".join(one.scenario) or "the one there is"), *_leading(one, cells)]
        for one in found
        if one.contest.comparisons
    ]
    table = grid(["scenario", "leaders", title, "baseline + none", "times better"], lines)
    return f'<h3>Who leads</h3>{bullets(summary(found))}{table}<p class="muted">{NOTE}</p>'


def _leading(one: Standing, cells: dict[Combination, Cell]) -> list[str]:
    contest = one.contest
    if not contest.decided:
        return [f"nobody: no difference shown between {len(contest.rivals)}", "", "", ""]
    leaders = sorted(contest.leaders, key=lambda key: _mean(cells.get(key)))
    names = ", ".join(f"<strong>{escape(one.name(key))}</strong>" for key in leaders[:LEADERS])
    more = f" and {len(leaders) - LEADERS} more" if len(leaders) > LEADERS else ""
    first = cells.get(leaders[0])
    baselines = [key for key in contest.rivals if key[3:5] == ("baseline", "none")]
    against = min((cells[key] for key in baselines if key in cells), key=_mean, default=None)
    factor = number(against.mean / first.mean) if against and first and 0 < first.mean < math.inf else ""
    return [
        f"{names}{more}",
        *(f"{cell.number} {small(cell.interval)}" if cell else "" for cell in (first, against)),
        factor,
    ]


def _mean(cell: Cell | None) -> float:
    return math.inf if cell is None or math.isnan(cell.mean) else cell.mean


def _claim(rows: "pd.DataFrame") -> str:
    """The headline, a table with a verdict for each case, and the sentences behind a fold."""
    found = claimed(rows)
    if not found:
        return ""
    varying = varying_factors(rows)
    opponents = list(dict.fromkeys(names(one, varying)[1] for one in found))
    cases: dict[str, dict[str, Comparison]] = {}
    for one in found:
        _, whom, where = names(one, varying)
        cases.setdefault(where.removeprefix(" on "), {})[whom] = one
    judged = {id(one): _judged(one, word) for one, word in zip(found, verdicts(found), strict=True)}
    lines = [
        [
            escape(case),
            *(judged[id(against[name])] if name in against else "" for name in opponents),
        ]
        for case, against in cases.items()
    ]
    table = grid(["case", *(f"times better than {name}" for name in opponents)], lines)
    head = f"<h3>The paper's claim: more than {CLAIMED:g} times better</h3>"
    sentences = fold("The same in sentences", bullets(claim_sentences(rows, found)))
    return f"{head}{bullets(headlines(rows, found))}{table}{sentences}"


def _judged(one: Comparison, word: str) -> str:
    lost = f"{sum(one.pair.lost)} lost" if any(one.pair.lost) else ""
    mark = f'<span class="{CLASSES.get(word, "muted")}">{word}</span>'
    if one.judgement.n == 0:
        return f"{mark} {small(lost)}"
    times, low, high = map(number, better(one))
    interval = f"[{low}, {high}]" if word in CLASSES else ""
    return f"{times} {small(interval)} {mark} {small(lost)}"


def _sentences(found: Sequence[Comparison], varying: Sequence[str]) -> str:
    """Every comparison in a sentence, scenario by scenario, behind folds."""
    if not found:
        return ""
    shown = [key for key in SCENARIO if key in varying]
    scenes: dict[str, list[Comparison]] = {}
    for one in found:
        values = dict(zip(FACTORS, one.subject, strict=True))
        scenes.setdefault(", ".join(values[key] for key in shown), []).append(one)
    folds = [fold(_counted(name, ones), bullets(_ordered(ones, varying))) for name, ones in scenes.items()]
    return f"<h3>Every comparison</h3>{''.join(folds)}"


def _counted(name: str, found: Sequence[Comparison]) -> str:
    where = f"{name}: " if name else ""
    if all(math.isnan(one.judgement.p) for one in found):
        return f"{where}{len(found)} comparisons, without a test (no seeds)"
    counts = Counter(one.verdict.value for one in found)
    return f"{where}{len(found)} comparisons: {', '.join(f'{count} {word}' for word, count in counts.items())}"


def _ordered(found: Sequence[Comparison], varying: Sequence[str]) -> list[str]:
    """Those that were shown first."""
    return [sentence(one, varying) for one in sorted(found, key=lambda one: not one.shown)]
