"""The group `jerkbench data`: each verb is a module here with ``add_arguments(parser)`` and ``answer(chosen)``.

Its first lines import next to nothing, because `jerkbench --help` asks every verb for its arguments.
"""

import argparse
from importlib import import_module
from types import ModuleType

from jerkbench.errors import JerkbenchError

VERBS = {
    "cache": "show what is kept in the user's cache, or clear it",
    "convert": "write a recording as a ROS bag, a table or a trajectory",
    "salvage": "write a fresh bag from what is whole in a ROS 1 bag that was cut off or damaged",
    "fetch": "download a public recording, check it, and keep it",
    "trace": "write the errors of a recording's fixes against its reference, to replay them elsewhere",
    "inspect": "print what a recording is made of, and what is wrong with it",
}
"""Each verb, and what it does."""


def add_verbs(parser: argparse.ArgumentParser) -> None:
    """Add the verbs to the parser of `jerkbench data`."""
    group = parser.add_subparsers(dest="data_verb", required=True, metavar="VERB")
    for name, title in VERBS.items():
        _module(name).add_arguments(group.add_parser(name, help=title, description=title[0].upper() + title[1:] + "."))


def answer(chosen: argparse.Namespace) -> None:
    """Do what the chosen verb is for."""
    try:
        _module(chosen.data_verb).answer(chosen)
    except OSError as error:
        where = error.filename or "A file"
        raise JerkbenchError(f"{where} cannot be read or written: {error.strerror}; correct the path.") from error


def _module(name: str) -> ModuleType:
    return import_module(f"jerkbench.data.{name}")
