"""`jerkbench suite`: a frozen comparison, declared as the verbs above it are."""

from jerkbench.verbs.arguments import Verbs
from jerkbench.verbs.suite import board, run, verify

VERBS = (run, verify, board)
"""In the order in which `jerkbench suite --help` names them."""


def add(verbs: Verbs) -> None:
    """Declare the verb, and those of its group."""
    names = [verb.__name__.rpartition(".")[2] for verb in VERBS]
    suite = verbs.add_parser("suite", help="enter a frozen comparison with a method of your own: " + ", ".join(names))
    group = suite.add_subparsers(dest="suite_verb", required=True, metavar="VERB")
    for verb in VERBS:
        verb.add(group)
