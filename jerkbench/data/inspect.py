"""`jerkbench data inspect`: what a recording is made of, and what is wrong with it."""

import argparse

from jerkbench.data.source import add_source, dataset_of


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    add_source(parser)


def answer(chosen: argparse.Namespace) -> None:
    """Print the facts of the recording."""
    from jerkbench.data.facts import facts_text

    recording = dataset_of(chosen.source, chosen.dataset, chosen.set).load(chosen.seed)
    print(facts_text(recording))
