"""`jerkbench list`: the names of what there is."""

import argparse

from jerkbench.verbs.arguments import Verbs, add_format, add_verb, print_json


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    listing = add_verb(verbs, "list", "name what there is, of every kind or of one", answer)
    listing.add_argument("kind", nargs="?", help="dataset, disturbance, attitude, filter, adaptation, ...")
    add_format(listing)


def answer(chosen: argparse.Namespace) -> None:
    """Print each name with one line about it.

    Raises:
        PluginError: no such kind.
    """
    from jerkbench.catalogue.catalogue_json import listed
    from jerkbench.catalogue.text import list_text

    if chosen.format == "json":
        print_json(listed(chosen.kind))
    else:
        print(list_text(chosen.kind))
