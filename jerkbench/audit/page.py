"""The page of an audit, written as method and results of a paper; every sentence with a number comes from the rows."""

from pathlib import Path

from jerkbench.audit.answer import last_line, sentences
from jerkbench.audit.family_verdicts import FamilyVerdict, family_sentences
from jerkbench.audit.protocol import HALVES, AuditProtocol
from jerkbench.audit.table import LEGEND, markdown_table
from jerkbench.audit.verdicts import MethodVerdict
from jerkbench.evaluation.statistics.judgement import Verdict

TEMPLATE = Path(__file__).with_name("page.md.jinja")


def page(
    protocol: AuditProtocol, scale: str, verdicts: list[MethodVerdict], by_family: list[FamilyVerdict], runs: int
) -> str:
    """Return the page as Markdown.

    Args:
        protocol: what was compared.
        scale: its name.
        verdicts: of every method.
        by_family: of every method under every family of faults.
        runs: how many were scored.
    """
    from jinja2 import Environment, StrictUndefined

    environment = Environment(undefined=StrictUndefined, keep_trailing_newline=True)  # noqa: S701 - Markdown, no HTML
    counts = {word: sum(verdict.verdict is word for verdict in verdicts) for word in Verdict}
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(
        p=protocol,
        scale=scale,
        halves={half: [family.name for family in protocol.families if family.half == half] for half in HALVES},
        sentences=sentences(verdicts, protocol),
        table=markdown_table(verdicts),
        legend=LEGEND,
        families=family_sentences(by_family),
        last=last_line(verdicts, protocol),
        verdicts=verdicts,
        counts=", ".join(f"{count} {word}" for word, count in counts.items() if count),
        runs=runs,
    )
