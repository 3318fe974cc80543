"""The table of an audit: one method a row."""

from collections.abc import Sequence

import pandas as pd

from jerkbench.audit.verdicts import MethodVerdict

HEADINGS = {
    "method": "method",
    "default": "defaults",
    "tuned": "tuned [95 %]",
    "verdict": "verdict",
    "p_better": "P",
    "worst": "worst scenario",
    "nominal": "nothing wrong",
    "lost": "lost [%]",
    "anees": "ANEES",
    "restarts": "restarts",
    "all_ratio": "all*",
    "bound": "each*",
    "step_ns": "ns",
    "places": "rank",
}
"""Columns of the printed table; those with a star are no fair scores."""

LEGEND = """\
Ratios of the position RMSE to the plain filter of the same model tuned alike; below 1 is better. *defaults*: at the
method's defaults. *tuned*: tuned on the other half of the faults, geometric mean over families, with its interval.
*verdict*: by an interval that holds for all methods at once. *P*: probability of being better by more than the margin.
*nothing wrong*: ratio without a fault, the price. *restarts*: lowest and highest of several searches, which is luck.
*all*, *each*: tuned on what it is scored on, on everything or on each scenario: no fair scores. *ns*: time a
step side by side. *rank*: among all tuned methods, with its range (95 %).
"""


def verdict_frame(verdicts: Sequence[MethodVerdict]) -> pd.DataFrame:
    """Return the numbers of every method, one a row."""
    return pd.DataFrame([_numbers(verdict) for verdict in verdicts])


def markdown_table(verdicts: Sequence[MethodVerdict]) -> str:
    """Return the table as Markdown, rounded."""
    rows = [list(_texts(verdict).values()) for verdict in verdicts]
    lines = [list(HEADINGS.values()), ["---"] * len(HEADINGS), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _numbers(verdict: MethodVerdict) -> dict[str, object]:
    place, place_low, place_high = verdict.places
    return {
        "filter": verdict.method.filter,
        "adaptation": verdict.method.adaptation,
        "default": verdict.default,
        "tuned": verdict.tuned.ratio,
        "low": verdict.tuned.low,
        "high": verdict.tuned.high,
        "low_of_all": verdict.low,
        "high_of_all": verdict.high,
        "verdict": str(verdict.verdict),
        "p_better": verdict.p_better,
        "worst": verdict.worst,
        "worst_ratio": verdict.worst_ratio,
        "nominal": verdict.nominal,
        "lost": verdict.lost,
        "anees": verdict.anees,
        "restart_low": verdict.restarts[0],
        "restart_high": verdict.restarts[1],
        "all_ratio": verdict.all_ratio,
        "bound": verdict.bound,
        "step_ns": verdict.step_ns,
        "place": place,
        "place_low": place_low,
        "place_high": place_high,
    }


def _texts(verdict: MethodVerdict) -> dict[str, str]:
    """The cells of a row, in the order of `HEADINGS`."""
    place, low, high = verdict.places
    return {
        "method": verdict.method.name,
        "default": f"{verdict.default:.2f}",
        "tuned": f"{verdict.tuned.ratio:.2f} [{verdict.tuned.low:.2f}, {verdict.tuned.high:.2f}]",
        "verdict": str(verdict.verdict),
        "p_better": f"{verdict.p_better:.2f}",
        "worst": f"{verdict.worst_ratio:.2f} ({verdict.worst})",
        "nominal": f"{verdict.nominal:.2f}",
        "lost": f"{100 * verdict.lost:.1f}",
        "anees": f"{verdict.anees:.1f}",
        "restarts": f"{verdict.restarts[0]:.2f} to {verdict.restarts[1]:.2f}",
        "all_ratio": f"{verdict.all_ratio:.2f}",
        "bound": f"{verdict.bound:.2f}",
        "step_ns": f"{verdict.step_ns:.0f}",
        "places": f"{place} ({low} to {high})",
    }
