"""`jerkbench data cache`: the content of the user's cache, its size, and how to delete it."""

import argparse

from jerkbench.verbs.arguments import Verbs, add_verb


def add(verbs: Verbs) -> None:
    """Declare the verb."""
    cache = add_verb(verbs, "cache", "show what is kept in the user's cache, or clear it", answer)
    cache.add_argument("--clear", action="store_true", help="delete it; all of it can be made again")


def answer(chosen: argparse.Namespace) -> None:
    """Print, or clear, each kind."""
    from jerkbench.verbs.data.kept import cache_kinds

    for kind in cache_kinds():
        files = kind.files()
        megabytes = sum(file.stat().st_size for file in files) / 1e6
        if chosen.clear:
            for file in files:
                file.unlink(missing_ok=True)
        done = ", deleted" if chosen.clear and files else ""
        print(f"{kind.title}: {len(files)} files, {megabytes:.1f} MB in {kind.folder}{done}")
