"""`jerkbench suite run`: a method, tuned and scored by a frozen protocol, becomes an entry."""

import argparse
import shlex
from pathlib import Path

from jerkbench.verbs.arguments import Verbs, add_verb, output

EPILOG = """\
KEY=VALUE are those of `jerkbench run` that make a method: filter, adaptation, noise, r_scale and what is in them.

  jerkbench suite run filter=jerk adaptation=mtf
  jerkbench suite run filter=baseline adaptation=my_rule --scale tiny       seconds: does it run?
  jerkbench suite run filter=command filter.command="./mine {recording} {out}" --name mine

A method whose parameters have ranges is tuned on one half of the faults and scored on the other, and the reverse; one
without, and a program, is scored as it is given. The plain filter is tuned alike. The same command goes on where it was
stopped. Written: entry.md, rows.parquet, settings.yaml, manifest.json (docs/suite.md).
"""


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    run = add_verb(verbs, "run", "tune and score a method by the suite's protocol, and write its entry", answer)
    run.formatter_class = argparse.RawDescriptionHelpFormatter
    run.epilog = EPILOG
    run.add_argument("words", nargs="+", metavar="KEY=VALUE", help="the method")
    run.add_argument("--scale", default="v1", help="name of the suite in conf/suite (default: v1)")
    run.add_argument("--name", default="", help="what the board calls it (default: filter + adaptation)")
    run.add_argument("--out", type=output, metavar="FOLDER", help="of the entry (default: results/suite-SCALE/NAME)")
    run.add_argument("--cluster", default="local", help="what runs it: local, dask, slurm, ... (default: local)")
    run.add_argument("--workers", type=int, default=0, help="number of processes (default: one a processor)")


def answer(chosen: argparse.Namespace) -> None:
    """Make the entry, and print it.

    Raises:
        JerkbenchError: a word is unknown, the method does not fit, or the suite is not the frozen one.
    """
    from jerkbench.execution.processors import processors
    from jerkbench.hydra_app.chosen_cluster import cluster_named
    from jerkbench.hydra_app.entering import entrant_of, folder_name
    from jerkbench.suite.campaign import Place
    from jerkbench.suite.enter import enter

    entrant = entrant_of(chosen.words)
    name = chosen.name or entrant.name
    folder = chosen.out or Path("results") / f"suite-{chosen.scale}" / folder_name(name)
    place = Place(folder, cluster_named(chosen.cluster), chosen.workers or processors())
    scale = [] if chosen.scale == "v1" else ["--scale", chosen.scale]
    command = shlex.join(["jerkbench", "suite", "run", *chosen.words, *scale])
    print(enter(chosen.scale, entrant, name, place, command))
    print(f"Written to {folder}.")
