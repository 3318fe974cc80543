"""`jerkbench suite board`: all entries of a folder as one page."""

import argparse
from pathlib import Path

from jerkbench.verbs.arguments import Verbs, add_verb, count


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    board = add_verb(verbs, "board", "write a sortable page of all entries of a folder, each verified", answer)
    board.add_argument("folder", type=Path, help="with a folder for each entry")
    board.add_argument(
        "--rows", type=count, default=3, help="how many rows of each entry to compute again (default: 3)"
    )


def answer(chosen: argparse.Namespace) -> None:
    """Write the pages, and name them.

    Raises:
        JerkbenchError: there is no entry, or they are of several suites.
    """
    from jerkbench.suite.board import write_board

    for path in write_board(chosen.folder, chosen.rows):
        print(path)
