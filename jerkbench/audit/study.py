"""The folder of an audit: its protocol before anything runs, then its rows, then what they say."""

import json
from pathlib import Path

from jerkbench.audit.answer import AuditAnswer, answered, changed_verdicts
from jerkbench.audit.campaign import Campaign
from jerkbench.audit.losses import losses_of
from jerkbench.audit.page import SECOND, write_page
from jerkbench.audit.pieces import RunLedger
from jerkbench.audit.protocol import AuditProtocol
from jerkbench.audit.stored import collected, read_rows, write_protocol
from jerkbench.audit.words import compared_text
from jerkbench.errors import JerkbenchError
from jerkbench.evaluation.statistics.drives_and_tunings import statements
from jerkbench.files import write_text
from jerkbench.jobs.cluster import Cluster, Workers
from jerkbench.jobs.key import code_digest, git_commit, versions
from jerkbench.notices import notify

FOLDER = "audit-"
"""The name of a folder begins with it; the scale follows."""

MANIFEST = "manifest.json"
CHANGED = "+changes"
"""The end of a commit with changes."""


def run_audit(protocol: AuditProtocol, folder: Path, cluster: Cluster, workers: int) -> AuditAnswer:
    """Run what is not stored in ``folder`` yet, and write the rows and the page.

    Args:
        protocol: what is compared.
        folder: of the audit.
        cluster: what runs it.
        workers: number of processes, where the cluster starts them.

    Raises:
        JerkbenchError: the folder has another protocol's results, or a run cannot be made.
        OSError: nothing can be written.
    """
    made = {"protocol": protocol.digest, "code": code_digest(), "git_commit": git_commit(), "versions": versions()}
    if git_commit().endswith(CHANGED):
        notify("the tree has changes that are not committed: nobody else can have this code, and the page says so")
    write_protocol(protocol, folder)
    with Workers(cluster, workers) as own:
        campaign = Campaign(protocol, RunLedger.of(protocol.digest, folder / "runs"), own)
        campaign.run(protocol.competing, "Audit")
        campaign.run(protocol.beside, "Other estimators")
    collected(campaign).write(folder)
    write_text(folder / MANIFEST, json.dumps(made, indent=1) + "\n")
    return judged_audit(folder)


def judged_audit(folder: Path) -> AuditAnswer:
    """Judge the rows in ``folder``, whatever version computed them, and write the page.

    Raises:
        JerkbenchError: there are none.
    """
    answer = answered(read_rows(folder))
    write_page(answer, folder, json.loads((folder / MANIFEST).read_text(encoding="utf-8"))["git_commit"])
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
