"""`jerkbench export`: the trajectory of one row, for other tools."""

import argparse

from jerkbench.verbs.arguments import Verbs, add_verb, output
from jerkbench.verbs.rerun import add_row


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    export = add_verb(verbs, "export", "write one row's estimate and reference as trajectories (TUM)", answer)
    add_row(export)
    export.add_argument("--tum", type=output, required=True, metavar="FOLDER", help="write estimate.tum, reference.tum")


def answer(chosen: argparse.Namespace) -> None:
    """Run the row again and write its trajectories.

    Raises:
        JerkbenchError: there is no such row, its data have changed, or it has no reference.
    """
    from jerkbench.evaluation.run import counted_rows
    from jerkbench.results.replay import stored_row
    from jerkbench.results.tum import write_tum_pair

    row = stored_row(chosen.folder, chosen.row)
    recording, estimate = row.run()
    counted = counted_rows(estimate, recording, row.cell.protocol.burn_in_s)
    for path in write_tum_pair(chosen.tum, recording, estimate, counted):
        print(path)
