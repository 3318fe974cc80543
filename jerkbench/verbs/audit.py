"""`jerkbench audit`: every adaptive filter against an equally tuned plain one, scored on what neither has seen."""

import argparse
from pathlib import Path

from jerkbench.verbs.arguments import Verbs, add_verb, output

EPILOG = """\
SCALE is a protocol in conf/audit: what is compared, under which faults, with which budget. The protocol and its hash
are written before anything runs, and the seeds to score on follow from the hash.

  jerkbench audit --scale small      minutes: shows that all of it runs, answers nothing
  jerkbench audit --scale medium     two models, without what iterates: half an hour
  jerkbench audit                    the whole protocol: 90 minutes on two cores
  jerkbench audit --attribution      what the gain of jerk and MTF over a naive baseline is made of

The same command goes on where it was stopped; --stored judges what is stored, whatever version computed it (its digest
stands in manifest.json), and runs nothing. RESULTS/audit-SCALE has README.md with the answer, its figures, table.md,
verdicts.csv, settings.csv, rows.parquet, manifest.json, protocol.json.
"""


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    audit = add_verb(verbs, "audit", "tune every adaptive filter and the plain one alike, score them unseen", answer)
    audit.formatter_class = argparse.RawDescriptionHelpFormatter
    audit.epilog = EPILOG
    audit.add_argument("--scale", help="name of the protocol (default: full, or attribution)")
    audit.add_argument("--attribution", action="store_true", help="what the gain over a naive baseline is made of")
    audit.add_argument("--results", type=output, default=Path("results"), help="folder of all results")
    audit.add_argument("--stored", action="store_true", help="judge the stored rows of any version, and run nothing")
    audit.add_argument("--cluster", default="local", help="what runs it: local, dask, slurm, ... (default: local)")
    audit.add_argument("--workers", type=int, default=0, help="number of processes (default: one a processor)")


def answer(chosen: argparse.Namespace) -> None:
    """Run the audit and print its answer.

    Raises:
        JerkbenchError: there is no such protocol, or a run failed.
    """
    from jerkbench.audit.attribution.study import run_attribution
    from jerkbench.audit.protocol import read_protocol
    from jerkbench.audit.study import FOLDER, run_audit, text_of
    from jerkbench.execution.processors import processors
    from jerkbench.hydra_app.chosen_cluster import cluster_named

    scale = ("attribution" if chosen.attribution else "full") if chosen.scale is None else chosen.scale
    protocol, folder = read_protocol(scale), chosen.results / f"{FOLDER}{scale}"
    cluster, workers = cluster_named(chosen.cluster), chosen.workers or processors()
    if chosen.attribution:
        run_attribution(protocol, folder, cluster, workers, only_stored=chosen.stored)
        print((folder / "README.md").read_text(encoding="utf-8"))
    else:
        print(text_of(run_audit(protocol, folder, cluster, workers, only_stored=chosen.stored)))
    print(f"Written to {folder}.")
