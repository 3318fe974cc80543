"""The part of the report that a reader sees first: what is best where, the paper's claim, and what differs."""

import math
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
    verdict,
)
from jerkbench.report.analysis.references import competes
from jerkbench.report.page.text import bullets, fold, grid, small
from jerkbench.report.tables.table_model import Cell, number

if TYPE_CHECKING:
    import pandas as pd

SCENARIO = ("dataset", "disturbance", "attitude")
METHOD = ("filter", "adaptation", "noise")
NOTE = (
    "The lowest number of the methods whose runs all went well; oracle, which is told the true covariance, and "
    "gnss_only, the floor, do not compete. Of several noises each method has its best, on these very runs. Times "
    "better: the quotient of the two numbers beside it, so each at its own best noise."
)

CLASSES = {HOLDS: "passed", FAILS: "failed", OPEN: "open"}


def findings_section(rows: "pd.DataFrame", metric: str, title: str, cells: dict[Combination, Cell]) -> str:
    """Return the leaders of each scenario, the claim, and every comparison in sentences.

    Args:
        rows: one row a cell and seed.
        metric: the leading metric.
        title: its name with the unit, and which mean it is.
        cells: its mean for each combination.
    """
    found = compared(rows, metric)
    parts = [_leaders(cells, title) if found else "", _claim(rows), _sentences(found, varying_factors(rows))]
    return "".join(parts) or bullets(["Nothing can be compared."])


def _leaders(cells: dict[Combination, Cell], title: str) -> str:
    """A line for each scenario: the best method, and how far the baseline at its best is behind it."""
    scenes: dict[Combination, dict[Combination, Cell]] = {}
    for combination, cell in cells.items():
        if cell.complete:
            scenes.setdefault(combination[:3], {})[combination[3:]] = cell
    shown = [place for place in range(3) if len({scene[place] for scene in scenes}) > 1] or [0]
    lines = [[*(escape(scene[place]) for place in shown), *_leader(found)] for scene, found in scenes.items()]
    heads = [*(SCENARIO[place] for place in shown), "best", title, "baseline + none", "times better"]
    return f'<h3>Best of each scenario</h3>{grid(heads, lines)}<p class="muted">{NOTE}</p>'


def _leader(found: dict[Combination, Cell]) -> list[str]:
    competing = {
        (name, adaptation, noise): cell
        for (name, adaptation, noise), cell in found.items()
        if competes({"filter": name, "adaptation": adaptation})
    }
    if not competing:
        return ["none came through", "", "", ""]
    method, cell = min(competing.items(), key=lambda one: one[1].mean)
    baselines = [one for (name, adaptation, _), one in competing.items() if (name, adaptation) == ("baseline", "none")]
    against = min(baselines, key=lambda one: one.mean, default=None)
    noise = f" ({method[2]})" if len({name for _, _, name in found}) > 1 and method[2] != "own" else ""
    return [
        f"<strong>{escape(' + '.join(method[:2]))}</strong>{escape(noise)}",
        f"{cell.number} {small(cell.interval)}",
        f"{against.number} {small(against.interval)}" if against else "",
        number(against.mean / cell.mean) if against and cell.mean else "",
    ]


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
    lines = [
        [escape(case), *(_judged(against[name]) if name in against else "" for name in opponents)]
        for case, against in cases.items()
    ]
    table = grid(["case", *(f"times better than {name}" for name in opponents)], lines)
    head = f"<h3>The paper's claim: more than {CLAIMED:g} times better</h3>"
    sentences = fold("The same in sentences", bullets(claim_sentences(rows, found)))
    return f"{head}{bullets(headlines(rows, found))}{table}{sentences}"


def _judged(one: Comparison) -> str:
    word = verdict(one)
    lost = f"{one.lost + one.lost_baseline} lost" if one.lost + one.lost_baseline else ""
    mark = f'<span class="{CLASSES.get(word, "muted")}">{word}</span>'
    if one.paired.n == 0:
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
    shown = sum(one.shown for one in found)
    where = f"{name}: " if name else ""
    if all(math.isnan(one.p) for one in found):
        return f"{where}{len(found)} comparisons, without a test (no seeds)"
    few = "; so few seeds cannot show any" if all(one.needed or math.isnan(one.p) for one in found) else ""
    return f"{where}a difference was shown in {shown} of {len(found)} comparisons{few}"


def _ordered(found: Sequence[Comparison], varying: Sequence[str]) -> list[str]:
    """Those that were shown first."""
    return [sentence(one, varying) for one in sorted(found, key=lambda one: not one.shown)]
