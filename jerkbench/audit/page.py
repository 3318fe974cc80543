"""The page of an audit, written as method and results of a paper; every sentence with a number comes from the rows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from jerkbench.audit.answer import last_line
from jerkbench.audit.protocol import AuditProtocol
from jerkbench.audit.verdicts import FamilyVerdict, MethodVerdict, family_sentences
from jerkbench.campaigns.protocol import HALVES
from jerkbench.evaluation.statistics.judgement import Verdict
from jerkbench.report.tables.writers import passive

TEMPLATE = Path(__file__).with_name("page.md.jinja")

SECTIONS = "sections"
"""Folder in an audit's; the page takes its Markdown files along, in order of their names."""


@dataclass(frozen=True)
class Contents:
    """What the page is made of.

    Attributes:
        protocol: what was compared.
        scale: its name.
        verdicts: of every method.
        by_family: of every method under every family of faults.
        sentences: the answer, the most important first.
        beside: sentences on what stands beside the verdicts.
        power: a sentence on what could have been shown.
        sections: further ones that somebody wrote, as Markdown; empty: there is none.
        runs: how many were scored.
    """

    protocol: AuditProtocol
    scale: str
    verdicts: Sequence[MethodVerdict]
    by_family: Sequence[FamilyVerdict]
    sentences: Sequence[str]
    beside: Sequence[str]
    power: str
    sections: str
    runs: int


def audit_page(contents: Contents) -> str:
    """Return the page as Markdown."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(  # noqa: S701 - Markdown, no HTML
        undefined=StrictUndefined, keep_trailing_newline=True, finalize=_shown
    )
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(_values(contents))


def _shown(value: object) -> object:
    """Show a text as text, but for the sections, which are Markdown."""
    return passive(value) if type(value) is str else value


def sections_in(folder: Path) -> str:
    """Return the further sections that lie in the folder of an audit."""
    return "\n".join(path.read_text(encoding="utf-8") for path in sorted((folder / SECTIONS).glob("*.md")))


def _values(contents: Contents) -> Mapping[str, object]:
    """The names of the template."""
    from markupsafe import Markup

    verdicts, protocol = contents.verdicts, contents.protocol
    counts = {word: sum(verdict.verdict is word for verdict in verdicts) for word in Verdict}
    return {
        **vars(contents),
        "sections": Markup(contents.sections),  # noqa: S704 - somebody's own Markdown
        "p": protocol,
        "adaptations": len({verdict.method.adaptation for verdict in verdicts}),
        "halves": {half: [f.name for f in protocol.families if f.half == half] for half in HALVES},
        "table": markdown_table(verdicts),
        "legend": LEGEND,
        "families": family_sentences(contents.by_family),
        "last": last_line(verdicts, protocol),
        "counts": ", ".join(f"{count} {word}" for word, count in counts.items() if count),
    }


# The table of verdicts.


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
