"""`jerkbench data`: verbs that look after recordings, declared as those above them are."""

from jerkbench.verbs.arguments import Verbs
from jerkbench.verbs.data import cache, convert, export, fetch, inspect, salvage, trace

VERBS = (inspect, convert, export, salvage, fetch, trace, cache)
"""In the order in which `jerkbench data --help` names them."""


def add(verbs: Verbs) -> None:
    """Declare the verb, and those of its group."""
    names = [verb.__name__.rpartition(".")[2] for verb in VERBS]
    data = verbs.add_parser("data", help="look after recordings: " + ", ".join(names))
    group = data.add_subparsers(dest="data_verb", required=True, metavar="VERB")
    for verb in VERBS:
        verb.add(group)
