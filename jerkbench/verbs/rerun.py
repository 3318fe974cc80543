"""`jerkbench rerun`: one row once more, from the configuration that is stored with it."""

import argparse
from pathlib import Path

from jerkbench.verbs.arguments import Verbs, add_run_programs, add_verb

DIFFERENT = 1
"""Exit code where a number is another."""


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    rerun = add_verb(verbs, "rerun", "run one row again, from its own stored configuration: the same numbers?", answer)
    add_row(rerun)


def add_row(parser: argparse.ArgumentParser) -> None:
    """Declare the words that say which row."""
    parser.add_argument("folder", type=Path, help="a study's folder, or a folder of cells")
    parser.add_argument("row", metavar="ROW", help="its number in rows.csv, from 1; or KEY:SEED of a file in cells/")
    add_run_programs(parser)


def answer(chosen: argparse.Namespace) -> None:
    """Print every metric as it was and as it is.

    Raises:
        JerkbenchError: there is no such row, or its data have changed.
        SystemExit: 1, where a number is another.
    """
    from jerkbench.report.tables.terminal import print_grid
    from jerkbench.results.replay import equal_or_nan, replay_differences, stored_row

    row = stored_row(chosen.folder, chosen.row, run_programs=chosen.run_programs)
    numbers = replay_differences(row)
    lines = [[name, repr(a), repr(b), "" if equal_or_nan(a, b) else "differs"] for name, a, b in numbers]
    notes = ["The code or a library is another than when the row was stored."] if row.code_changed else []
    print_grid(f"{', '.join(row.cell.labels)}, {row.row['replicate']} {row.draw}", ["", "was", "is", ""], lines, notes)
    differing = sum(not equal_or_nan(a, b) for _, a, b in numbers)
    print(f"{differing} of {len(numbers)} numbers differ.")
    if differing:
        raise SystemExit(DIFFERENT)
