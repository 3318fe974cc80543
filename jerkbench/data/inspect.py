"""`jerkbench data inspect`: what a recording is made of, and what is wrong with it."""

import argparse
from pathlib import Path

from jerkbench.data.source import add_source, dataset_of


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    add_source(parser)


def answer(chosen: argparse.Namespace) -> None:
    """Print the topics of a bag, then the facts of the recording that the data set makes of it."""
    from jerkbench.bags.options import BagOptions
    from jerkbench.data.facts import facts_text
    from jerkbench.errors import RecordingError

    dataset = dataset_of(chosen.source, chosen.dataset, chosen.set)
    if not isinstance(dataset, BagOptions):
        print(facts_text(dataset.load(chosen.seed)))
        return
    _print_topics(Path(dataset.file).expanduser())
    try:
        print(f"\n{facts_text(dataset.load(chosen.seed))}")
    except RecordingError as error:  # the bag can be read: what it lacks is an answer
        print(f"\nNo recording can be made of it as it is: {error}")


def _print_topics(path: Path) -> None:
    from jerkbench.bags.survey import survey
    from jerkbench.readers.ros.bag import open_bag

    with open_bag(path) as bag:
        for line in survey(bag):
            print(line)
