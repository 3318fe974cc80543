"""The folder of an audit: its runs, verdicts, settings, and the answer in words."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import pandas as pd

from jerkbench.audit.answer import (
    metric_sentence,
    model_sentence,
    noise_sentence,
    power_sentence,
    reference_sentences,
    sentences,
    tuning_sentence,
)
from jerkbench.audit.campaign import AuditCampaign, Outcome
from jerkbench.audit.figures import audit_severity_figure, family_figure, model_figure, ratio_figure
from jerkbench.audit.methods import AuditMethod, methods
from jerkbench.audit.page import LEGEND, Contents, audit_page, markdown_table, sections_in, verdict_frame
from jerkbench.audit.protocol import AuditProtocol
from jerkbench.audit.stages import Stages
from jerkbench.audit.verdicts import (
    FamilyVerdict,
    Losses,
    MethodVerdict,
    family_frame,
    family_verdicts,
    losses_of,
    verdicts,
)
from jerkbench.campaigns.protocol import FaultScenario
from jerkbench.campaigns.site import Site
from jerkbench.files import write_atomically, write_text
from jerkbench.jobs.cluster import Cluster, Workers
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.report.plots.style import save_figure
from jerkbench.tuning.space import Space

FOLDER = "audit-"
"""The name of a folder begins with it; the scale follows."""


@dataclass(frozen=True)
class Audit:
    """What an audit found.

    Attributes:
        protocol: what was compared.
        outcome: settings and runs.
        losses: of every method on the seeds to test on.
        verdicts: of every method, the best first.
        by_family: of every method under every family of faults.
    """

    protocol: AuditProtocol
    outcome: Outcome
    losses: Losses
    verdicts: list[MethodVerdict]
    by_family: list[FamilyVerdict]


def run_audit(
    protocol: AuditProtocol, folder: Path, cluster: Cluster, workers: int, *, only_stored: bool = False
) -> Audit:
    """Run what is not stored in ``folder`` yet, judge it, and write the tables.

    Args:
        protocol: what is compared.
        folder: of the audit.
        cluster: what runs it.
        workers: number of processes, where the cluster starts them.
        only_stored: run nothing, and judge the rows that are stored, whatever code computed them.

    Raises:
        JerkbenchError: a run failed, or is not stored and may not be run.
        OSError: nothing can be written.
    """
    known, compared = protocol.scenarios, methods(protocol)
    with Workers(cluster, workers) as own:
        place = Site(folder / "runs", own, only_stored)
        stages = Stages(known, place)
        if only_stored:
            compared = stages.stored_methods(compared, protocol.seeds_to_tune_on)
        else:
            write_text(folder / "protocol.json", _protocol_text(protocol))
        spaces = {method: method.space(known[0]) for method in compared}
        outcome = AuditCampaign(protocol, spaces, stages).run()
    audit = judged_audit(protocol, outcome, known)
    _write(audit, folder, spaces, place.makers())
    return audit


def judged_audit(protocol: AuditProtocol, outcome: Outcome, known: Sequence[FaultScenario]) -> Audit:
    """Return the verdicts of what was run."""
    losses = losses_of(outcome, protocol, known)
    overall = verdicts(outcome, protocol, known)
    by_family = family_verdicts(losses, [verdict.method for verdict in overall], protocol)
    return Audit(protocol, outcome, losses, overall, by_family)


def text_of(audit: Audit) -> str:
    """Return sentences and table as Markdown."""
    lines = [f"- {sentence}" for sentence in _sentences(audit)]
    head = f"Protocol version {audit.protocol.version}, {audit.protocol.digest}."
    return "\n".join([*lines, "", head, LEGEND, markdown_table(audit.verdicts)])


def _sentences(audit: Audit) -> list[str]:
    return sentences(audit.verdicts, audit.protocol, tuning_sentence(audit.losses, audit.protocol))


def contents_of(audit: Audit, scale: str, sections: str = "") -> Contents:
    """Return what the page is made of, with further ``sections`` that somebody wrote."""
    protocol, losses, judged = audit.protocol, audit.losses, audit.verdicts
    beside = [
        *reference_sentences(losses, protocol),
        model_sentence(losses, protocol),
        noise_sentence(losses, judged, protocol),
        metric_sentence(audit.outcome, losses, judged, protocol),
    ]
    return Contents(
        protocol=protocol,
        scale=scale,
        verdicts=judged,
        by_family=audit.by_family,
        sentences=_sentences(audit),
        beside=[sentence for sentence in beside if sentence],
        power=power_sentence(judged, protocol),
        sections=sections,
        runs=len(audit.outcome.test),
    )


def settings_frame(outcome: Outcome, spaces: Mapping[AuditMethod, Space]) -> pd.DataFrame:
    """Return the setting that each search chose, a knob a row."""
    return pd.DataFrame(
        [
            {
                "filter": search.method.filter,
                "adaptation": search.method.adaptation,
                "tuned_on": search.tuned_on,
                "restart": search.restart,
                "knob": name,
                "value": value,
            }
            for search, setting in outcome.chosen.items()
            for name, value in zip(spaces[search.method].names, setting, strict=True)
        ]
    )


def _write(audit: Audit, folder: Path, spaces: Mapping[AuditMethod, Space], makers: list[str]) -> None:
    texts = {
        "README.md": audit_page(contents_of(audit, folder.name.removeprefix(FOLDER), sections_in(folder))),
        "table.md": text_of(audit),
        "verdicts.csv": verdict_frame(audit.verdicts).to_csv(index=False, lineterminator="\n"),
        "families.csv": family_frame(audit.by_family).to_csv(index=False, lineterminator="\n"),
        "settings.csv": settings_frame(audit.outcome, spaces).to_csv(index=False, lineterminator="\n"),
        "manifest.json": json.dumps({**_manifest(audit.protocol), "rows_computed_by": makers}, indent=1),
    }
    for name, text in texts.items():
        write_text(folder / name, text)
    save_figure(ratio_figure(audit.verdicts, audit.protocol.margin), folder / "ratios.png")
    save_figure(model_figure(audit.verdicts, audit.protocol.margin), folder / "models.png")
    save_figure(audit_severity_figure(audit.losses, audit.verdicts, audit.protocol), folder / "severity.png")
    save_figure(family_figure(audit.by_family), folder / "families.png")
    write_atomically(folder / "rows.parquet", lambda path: audit.outcome.test.to_parquet(path, index=False))


def _manifest(protocol: AuditProtocol) -> dict[str, object]:
    return {
        "protocol": protocol.digest,
        "seeds": {
            "tune": protocol.seeds_to_tune_on,
            "choose": protocol.seeds_to_choose_on,
            "test": protocol.seeds_to_test_on,
        },
        "code": code_digest(),
        "git_commit": git_commit(),
        "versions": versions(),
    }


def _protocol_text(protocol: AuditProtocol) -> str:
    return json.dumps({"digest": protocol.digest, **asdict(protocol)}, indent=1)
