"""The folder of an audit: its protocol before anything runs, then its rows, then what they say."""

import json
from pathlib import Path

from jerkbench.audit.answer import Answer, answered, changed_verdicts
from jerkbench.audit.campaign import Campaign
from jerkbench.audit.losses import losses_of
from jerkbench.audit.page import SECOND, write_page
from jerkbench.audit.pieces import Ledger
from jerkbench.audit.protocol import AuditProtocol
from jerkbench.audit.stored import collected, manifest, read_rows, write_protocol
from jerkbench.audit.words import compared_text
from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.statistics.drives_and_tunings import statements
from jerkbench.files import write_text
from jerkbench.jobs.cluster import Cluster, Workers
from jerkbench.jobs.key import git_commit
from jerkbench.notices import notify

FOLDER = "audit-"
"""The name of a folder begins with it; the scale follows."""

CHANGED = "+changes"
"""The end of a commit with changes."""


def run_audit(
    protocol: AuditProtocol, folder: Path, cluster: Cluster, workers: int, *, only_stored: bool = False
) -> Answer:
    """Run what is not stored in ``folder`` yet, and write the rows and the page.

    Args:
        protocol: what is compared.
        folder: of the audit.
        cluster: what runs it.
        workers: number of processes, where the cluster starts them.
        only_stored: run nothing, and take what is stored, whatever code computed it.

    Raises:
        JerkbenchError: a run failed, or is not stored and may not be run.
        OSError: nothing can be written.
    """
    if git_commit().endswith(CHANGED):
        notify("the tree has changes that are not committed: nobody else can have this code, and the page says so")
    write_protocol(protocol, folder)
    ledger = Ledger(folder / "runs", protocol.digest, any_code=only_stored)
    with Workers(cluster, workers) as own:
        campaign = Campaign(protocol, ledger, None if only_stored else own)
        campaign.run(protocol.competing, "Audit")
        campaign.run(protocol.beside, "Other estimators")
    rows = collected(campaign, [*protocol.competing, *protocol.beside])
    rows.write(folder)
    made = manifest(protocol, ledger.makers())
    write_text(folder / "manifest.json", json.dumps(made, indent=1))
    answer = answered(rows)
    write_page(answer, folder, ", ".join(sorted({own["commit"] for own in made["rows_computed_by"]})))
    return answer


def compare_audits(folder: Path, other: Path) -> str:
    """Compare two audits of the same methods, and put what they do not share on the page of the first.

    Raises:
        JerkbenchError: one is not there, or they are of other methods.
    """
    rows = [read_rows(each) for each in (folder, other)]
    methods = [each.protocol.methods for each in rows]
    if methods[0] != methods[1]:
        raise JerkbenchError(f"{folder} and {other} compare other methods; give two audits of the same.")
    first, second = (statements(losses_of(each)) for each in rows)
    changed = changed_verdicts(first, second, methods[0])
    text = compared_text(changed, 2 * len(methods[0]), first, second)
    write_text(folder / SECOND, text)
    return text
