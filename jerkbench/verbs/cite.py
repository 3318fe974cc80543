"""`jerkbench cite`: BibTeX of what a study used."""

import argparse
from pathlib import Path

from jerkbench.verbs.arguments import Verbs, add_verb


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    cite = add_verb(verbs, "cite", "print BibTeX of every method and data set of a study, and of jerkbench", answer)
    cite.add_argument("folder", nargs="?", type=Path, help="the study's folder (default: jerkbench alone)")


def answer(chosen: argparse.Namespace) -> None:
    """Print the entries.

    Raises:
        JerkbenchError: the folder cannot be read.
    """
    from jerkbench.results.bibliography import entries_of, own_entry

    print("\n\n".join(entries_of(chosen.folder) if chosen.folder else [own_entry()]))
