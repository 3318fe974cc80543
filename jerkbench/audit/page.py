"""The page of an audit, written as method and results of a paper; every sentence with a number comes from the rows."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from jerkbench.audit.answer import last_line
from jerkbench.audit.family_verdicts import FamilyVerdict, family_sentences
from jerkbench.audit.protocol import AuditProtocol
from jerkbench.audit.table import LEGEND, markdown_table
from jerkbench.audit.verdicts import MethodVerdict
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
