"""The declaration of a verb, and the words that several verbs take."""

import argparse
import inspect
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jerkbench.errors import JerkbenchError

if TYPE_CHECKING:
    from jerkbench.report.comparisons import VerdictRule

    Parsers = argparse._SubParsersAction[argparse.ArgumentParser]  # noqa: SLF001 - argparse has no public name for it

Argument = tuple[tuple[str, ...], dict[str, Any]]
"""What `argparse.ArgumentParser.add_argument` takes."""

Answering = Callable[[argparse.Namespace], None]

Declaration = Callable[["Parsers"], None]


def verb(*arguments: Argument) -> Callable[[Answering], Declaration]:
    """Declare the command that a function runs. Its name is the name of the function, and its docstring is the help."""

    def declaration(answer: Answering) -> Declaration:
        name = answer.__name__.removesuffix("_verb").rpartition("_")[2]
        title, _, text = inspect.cleandoc(str(answer.__doc__)).partition("\n")

        def declare(parsers: "Parsers") -> None:
            parser = parsers.add_parser(name, help=f"{title[0].lower()}{title[1:-1]}", description=title)
            parser.epilog = text.partition("\nRaises:")[0].strip("\n")
            parser.formatter_class = argparse.RawDescriptionHelpFormatter
            for names, options in arguments:
                parser.add_argument(*names, **options)
            parser.set_defaults(answer=answer)

        return declare

    return declaration


def group(name: str, title: str, *verbs: Declaration) -> Declaration:
    """Put verbs behind a common first word."""

    def declare(parsers: "Parsers") -> None:
        inner = parsers.add_parser(name, help=title).add_subparsers(dest=f"{name}_verb", required=True, metavar="VERB")
        for declared in verbs:
            declared(inner)

    return declare


def argument(*names: str, **options: Any) -> Argument:  # noqa: ANN401 - as argparse has them
    """Return a word of a verb, given as `argparse.ArgumentParser.add_argument` takes it."""
    return names, options


def print_json(content: object) -> None:
    """Print plain values as JSON."""
    print(json.dumps(content, indent=2, allow_nan=False))


def require_new(path: Path) -> None:
    """Refuse to write over a file or folder.

    Raises:
        JerkbenchError: it is there.
    """
    if path.exists():
        raise JerkbenchError(f"{path} is there already; delete it or give another name.")


def count(text: str) -> int:
    """Read a number of things.

    Raises:
        ArgumentTypeError: it is none.
    """
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"'{text}' is no whole number; give 0 or more")
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


STUDY = argument("folder", type=Path, help="the study's folder, for example results/paper, or a folder of cells")

ANSWER_FORMAT = argument("--format", choices=("terminal", "json"), default="terminal", help="default: terminal")
"""Lets a verb answer a program too."""

RUN_PROGRAMS = argument(
    "--run-programs",
    action="store_true",
    help="let programs that stored results name (filter=command) run here: only of results that you trust",
)
"""Lets programs of stored results run."""

WHERE = (
    argument("--cluster", default="local", help="what runs it: local, dask, slurm, ... (default: local)"),
    argument("--workers", type=int, default=0, help="number of processes (default: one a processor)"),
)
"""Where something is run."""

JUDGING = (
    argument(
        "--method",
        metavar="FACTORS",
        help="what a method is made of (default: filter,adaptation,noise; the attitude where it alone varies); "
        "the rest makes a scenario",
    ),
    argument(
        "--margin",
        type=percentage,
        default=3.0,
        metavar="PCT",
        help="methods within PCT percent are equal (default: 3)",
    ),
)
"""How a study's methods are judged."""


def judging(chosen: argparse.Namespace) -> "tuple[tuple[str, ...] | None, VerdictRule]":
    """Return the factors of a method (None: the default ones) and the rule that was asked for.

    Raises:
        JerkbenchError: there is no such factor, or none.
    """
    from jerkbench.report.columns import parse_method
    from jerkbench.report.comparisons import VerdictRule

    return None if chosen.method is None else parse_method(chosen.method), VerdictRule(chosen.margin / 100)
