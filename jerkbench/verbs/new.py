"""`jerkbench new`: a package for a plugin of one's own, to begin from."""

import argparse
from pathlib import Path

from jerkbench.verbs.arguments import Verbs, add_verb, output


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    new = add_verb(verbs, "new", "write a package with a plugin of your own: class, entry point, test, README", answer)
    new.add_argument("kind", help="dataset, disturbance, attitude, filter, estimator, adaptation or metric")
    new.add_argument("name", help="of the plugin and its module, for example my_rule")
    new.add_argument("--out", type=output, metavar="FOLDER", help="where it goes (default: a folder of its name, here)")


def answer(chosen: argparse.Namespace) -> None:
    """Write the package, and name each file.

    Raises:
        PluginError: no such kind, no possible name, one that is taken, or there is something in the folder.
    """
    from jerkbench.authoring.package import write_package

    for path in write_package(chosen.kind, chosen.name, chosen.out or Path(chosen.name)):
        print(path)
