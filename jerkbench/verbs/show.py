"""`jerkbench show`: one plugin or preset, from its own words."""

import argparse

from jerkbench.verbs.arguments import Verbs, add_format, add_verb, print_json


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    show = add_verb(verbs, "show", "print equations, parameters, defaults and source of one plugin or preset", answer)
    show.add_argument("kind", help="dataset, disturbance, attitude, filter, adaptation, ...; may be left out")
    show.add_argument("name", nargs="?")
    add_format(show)


def answer(chosen: argparse.Namespace) -> None:
    """Print all there is to know of it.

    Raises:
        PluginError: there is none of that name.
    """
    from jerkbench.catalogue.catalogue_json import shown
    from jerkbench.catalogue.entries import kind_of
    from jerkbench.catalogue.text import show_text

    if chosen.name is None:
        chosen.kind, chosen.name = kind_of(chosen.kind), chosen.kind
    if chosen.format == "json":
        print_json(shown(chosen.kind, chosen.name))
    else:
        print(show_text(chosen.kind, chosen.name))
