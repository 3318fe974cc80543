"""`jerkbench suite verify`: whether an entry is what it says."""

import argparse
from pathlib import Path

from jerkbench.verbs.arguments import Verbs, add_run_programs, add_verb, count


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    verify = add_verb(verbs, "verify", "check digests, completeness, score and a sample of rows of an entry", answer)
    verify.add_argument("entry", type=Path, help="its folder")
    add_run_programs(verify)
    verify.add_argument("--rows", type=count, default=12, help="how many rows to compute once more (default: 12)")


def answer(chosen: argparse.Namespace) -> None:
    """Print what is wrong, a sentence each; exits with 1 where anything is.

    Raises:
        JerkbenchError: there is no entry.
    """
    from jerkbench.suite.verify import verify

    checked = verify(chosen.entry, chosen.rows, run_programs=chosen.run_programs)
    for sentence in (*checked.mistakes, *checked.remarks):
        print(sentence)
    if checked.mistakes:
        raise SystemExit(1)
    print(
        f"{chosen.entry} is what it says, as far as was checked; {checked.rerun} of its own rows were computed again."
    )
