"""The folder of an audit: its protocol before anything runs, then its rows, then what they say."""

import json
from pathlib import Path

from jerkbench.audit.campaign import Campaign
from jerkbench.audit.pieces import Ledger
from jerkbench.audit.protocol import AuditProtocol
from jerkbench.audit.stored import AuditRows, collected, manifest, write_protocol
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
) -> AuditRows:
    """Run what is not stored in ``folder`` yet, and write the rows.

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
    write_text(folder / "manifest.json", json.dumps(manifest(protocol, ledger.makers()), indent=1))
    return rows
