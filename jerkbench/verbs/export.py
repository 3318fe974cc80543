"""`jerkbench export`: the trajectory and the updates of one row, for other tools."""

import argparse
from typing import TYPE_CHECKING

from jerkbench.errors import JerkbenchError
from jerkbench.verbs.arguments import Verbs, add_verb, output
from jerkbench.verbs.rerun import add_row

if TYPE_CHECKING:
    from jerkbench.results.replay import StoredRow

NOTHING = "What is to be exported? Give --tum FOLDER for trajectories, --updates FILE.csv for the adapted R, or both."


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    export = add_verb(verbs, "export", "write one row's trajectories (TUM), or its updates with the adapted R", answer)
    add_row(export)
    export.add_argument("--tum", type=output, metavar="FOLDER", help="write estimate.tum, reference.tum")
    export.add_argument(
        "--updates", type=output, metavar="FILE.csv", help="write each update: innovation, NIS, the R that was used"
    )


def answer(chosen: argparse.Namespace) -> None:
    """Run the row again and write what is asked for.

    Raises:
        JerkbenchError: nothing is, there is no such row, its data have changed, or it has no reference or no updates.
    """
    from jerkbench.results.replay import stored_row
    from jerkbench.results.updates_table import write_updates

    if chosen.tum is None and chosen.updates is None:
        raise JerkbenchError(NOTHING)
    row = stored_row(chosen.folder, chosen.row, run_programs=chosen.run_programs)
    if chosen.tum is not None:
        _write_trajectories(chosen, row)
    if chosen.updates is not None:
        _, estimate = row.run()
        write_updates(chosen.updates, estimate.updates)
        print(chosen.updates)


def _write_trajectories(chosen: argparse.Namespace, row: "StoredRow") -> None:
    from jerkbench.evaluation.counted_rows import counted_rows
    from jerkbench.results.tum import write_tum_pair

    recording, estimate = row.run()
    counted = counted_rows(estimate, recording, row.cell.protocol.burn_in_s)
    for path in write_tum_pair(chosen.tum, recording, estimate, counted):
        print(path)
