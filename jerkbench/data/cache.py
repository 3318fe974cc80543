"""`jerkbench data cache`: what is kept to be read or run faster, how large it is, and how to be rid of it."""

import argparse
from pathlib import Path

COMPILED = ("jerkbench_*.py", "__pycache__/jerkbench_*")
"""Files of ours in the folder of compiled code, which may be one that the user named."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the verb."""
    parser.add_argument("--clear", action="store_true", help="delete it; all of it can be made again")


def answer(chosen: argparse.Namespace) -> None:
    """Print, or clear, each part. Recordings that were fetched are no part of it."""
    from jerkbench.bags.extract import cache_folder as bags
    from jerkbench.compilation.entry import cache_folder as compiled

    parts = {"compiled filters and adaptations": (compiled(), COMPILED), "what was read of bags": (bags(), ("*.npz",))}
    for what, (folder, patterns) in parts.items():
        files = [file for pattern in patterns for file in sorted(folder.glob(pattern)) if file.is_file()]
        size = sum(file.stat().st_size for file in files) / 1e6
        if chosen.clear:
            _delete(files)
        print(f"{what}: {len(files)} files, {size:.1f} MB in {folder}{', deleted' if chosen.clear and files else ''}")


def _delete(files: list[Path]) -> None:
    for file in files:
        file.unlink(missing_ok=True)
