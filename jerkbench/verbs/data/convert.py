"""`jerkbench data convert`: any recording into a bag, a table or a trajectory."""

import argparse
from pathlib import Path

from jerkbench.verbs.arguments import Verbs, add_verb
from jerkbench.verbs.data.source import add_source, dataset_of

TARGETS = {
    ".bag": "ROS 1 bag",
    ".db3": "ROS 2 bag, sqlite3",
    ".mcap": "ROS 2 bag, mcap",
    ".csv": "table",
    ".parquet": "table",
    ".tum": "trajectory as text",
    ".kml": "trajectory on the Earth",
}


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    convert = add_verb(verbs, "convert", "write a recording as a ROS bag, a table or a trajectory", answer)
    convert.epilog = "TARGET ends in: " + ", ".join(f"{suffix} ({title})" for suffix, title in TARGETS.items())
    add_source(convert)
    convert.add_argument("target", type=Path, help="the file to write; its suffix says what")
    convert.add_argument(
        "--coordinates", choices=("enu", "geodetic", "ned"), default="enu", help="of a table's positions"
    )
    convert.add_argument(
        "--stream", choices=("reference", "position"), help="which trajectory (default: the reference's)"
    )


def answer(chosen: argparse.Namespace) -> None:
    """Write the target."""
    from jerkbench.errors import JerkbenchError, unknown

    target: Path = chosen.target
    if target.suffix not in TARGETS:
        raise JerkbenchError(unknown("suffix of a target", target.suffix, TARGETS))
    if target.exists():
        raise JerkbenchError(f"{target} is there already; delete it or give another name.")
    recording = dataset_of(chosen.source, chosen.dataset, chosen.set).load(chosen.seed)
    left_out: list[str] = []
    if target.suffix in (".csv", ".parquet"):
        from jerkbench.io.writing import write_table

        write_table(recording, target, chosen.coordinates)
    elif target.suffix in (".tum", ".kml"):
        from jerkbench.io.writing import write_kml, write_tum

        (write_tum if target.suffix == ".tum" else write_kml)(recording, target, chosen.stream)
    else:
        from jerkbench.io.ros.writing import write_bag

        left_out = write_bag(recording, target)
    print(f"{target}: {recording.name} as {TARGETS[target.suffix]}")
    for sentence in left_out:
        print(sentence)
