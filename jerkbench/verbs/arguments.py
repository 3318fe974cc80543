"""The declaration of a verb, and the types of its words."""

import argparse
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    Verbs = argparse._SubParsersAction[argparse.ArgumentParser]  # noqa: SLF001 - argparse has no public name for it
else:
    Verbs = Any


def add_verb(
    verbs: Verbs, name: str, title: str, answer: Callable[[argparse.Namespace], None]
) -> argparse.ArgumentParser:
    """Declare the verb ``name``, which does what ``title`` says by calling ``answer``; returns where its words go."""
    parser = verbs.add_parser(name, help=title, description=f"{title[0].upper()}{title[1:]}.")
    parser.set_defaults(answer=answer)
    return parser


def add_format(parser: argparse.ArgumentParser) -> None:
    """Let a verb answer a program too: ``--format json``."""
    parser.add_argument("--format", choices=("terminal", "json"), default="terminal", help="default: terminal")


def print_json(content: object) -> None:
    """Print plain values as JSON."""
    print(json.dumps(content, indent=2, allow_nan=False))


def count(text: str) -> int:
    """Read a number of things.

    Raises:
        ArgumentTypeError: it is none.
    """
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"'{text}' is no number of scenarios; give 0 or more")
    return int(text)


def output(text: str) -> Path:
    """Read the path of a file or folder to write.

    Raises:
        ArgumentTypeError: it is empty.
    """
    if not text.strip():
        raise argparse.ArgumentTypeError("the path is empty; give the name of a file or folder")
    return Path(text)


def percentage(text: str) -> float:
    """Read a limit in percent.

    Raises:
        ArgumentTypeError: it is no number that a change could exceed.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > -100.0):
        raise argparse.ArgumentTypeError(f"'{text}' is no percentage; give a number, for example 5")
    return value


def add_run_programs(parser: argparse.ArgumentParser) -> None:
    """Declare the word that lets programs of stored results run."""
    parser.add_argument(
        "--run-programs",
        action="store_true",
        help="let programs that stored results name (filter=command) run here: only of results that you trust",
    )
