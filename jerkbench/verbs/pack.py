"""`jerkbench pack`: a study's rows in one file, small enough to be kept in a repository."""

import argparse
from pathlib import Path

from jerkbench.verbs.arguments import Verbs, add_verb


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    pack = add_verb(verbs, "pack", "join a study's rows into one file, and leave out cells that are not whole", answer)
    pack.add_argument("folder", type=Path, help="the study's folder")


def answer(chosen: argparse.Namespace) -> None:
    """Join them, and name the file.

    Raises:
        JerkbenchError: there are no results, or some are damaged.
    """
    from jerkbench.results.store import Store

    path = Store(chosen.folder).pack()
    print(f"{path}: {path.stat().st_size / 1024:.0f} KiB")
