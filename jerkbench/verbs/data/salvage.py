"""`jerkbench data salvage`: a fresh bag from the intact part of a damaged one."""

import argparse
from pathlib import Path

from jerkbench.verbs.arguments import Verbs, add_verb


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    salvage = add_verb(
        verbs, "salvage", "write a fresh bag from what is whole in a ROS 1 bag that was cut off or damaged", answer
    )
    salvage.add_argument("source", type=Path, help="a ROS 1 bag that was cut off or damaged")
    salvage.add_argument("target", type=Path, help="the bag to write")


def answer(chosen: argparse.Namespace) -> None:
    """Write the target, and print what could be saved."""
    from jerkbench.io.ros.salvage import salvage

    saved = salvage(chosen.source, chosen.target)
    print(f"{chosen.target}: {sum(saved.messages.values())} messages from {saved.chunks} chunks")
    for topic, count in sorted(saved.messages.items()):
        print(f"  {topic}: {count}")
    if saved.cut_chunks or saved.lost_bytes:
        print(f"Chunks that were not whole: {saved.cut_chunks}; bytes that belong to none: {saved.lost_bytes}.")
