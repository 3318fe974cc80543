"""Functions that declare commands, and the arguments that several commands share."""

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
"""The parameters for a call of `argparse.ArgumentParser.add_argument`."""

CommandFunction = Callable[[argparse.Namespace], None]

Declaration = Callable[["Parsers"], None]


def command(*arguments: Argument) -> Callable[[CommandFunction], Declaration]:
    """Return a decorator that declares a command with the name and the docstring of the decorated function."""

    def declaration(function: CommandFunction) -> Declaration:
        name = function.__name__.removesuffix("_command").rpartition("_")[2]
        title, _, text = inspect.cleandoc(str(function.__doc__)).partition("\n")

        def declare(parsers: "Parsers") -> None:
            parser = parsers.add_parser(name, help=f"{title[0].lower()}{title[1:-1]}", description=title)
            parser.epilog = text.partition("\nRaises:")[0].strip("\n")
            parser.formatter_class = argparse.RawDescriptionHelpFormatter
            for names, options in arguments:
                parser.add_argument(*names, **options)
            parser.set_defaults(function=function)

        return declare

    return declaration


def group(name: str, title: str, *commands: Declaration) -> Declaration:
    """Declare a command that has subcommands, such as `jerkbench suite run`."""

    def declare(parsers: "Parsers") -> None:
        parser = parsers.add_parser(name, help=title)
        inner = parser.add_subparsers(dest=f"{name}_command", required=True, metavar="COMMAND")
        for declared in commands:
            declared(inner)

    return declare


def argument(*names: str, **options: Any) -> Argument:  # noqa: ANN401 - argparse declares the types
    """Declare an argument of a command, with the parameters of `argparse.ArgumentParser.add_argument`."""
    return names, options


def flag(*names: str, help: str) -> Argument:  # noqa: A002 - the name that argparse uses
    """Declare an option without a value."""
    return argument(*names, action="store_true", help=help)


def print_json(content: object) -> None:
    """Print plain data in the JSON format."""
    print(json.dumps(content, indent=2, allow_nan=False))


def require_new(path: Path) -> None:
    """Raise an exception if a path already exists, so that nothing is overwritten.

    Raises:
        JerkbenchError: The path exists.
    """
    if path.exists():
        raise JerkbenchError(f"{path} already exists; delete {path}, or give another name.")


def count(text: str) -> int:
    """Parse a number of runs, rows or scenarios.

    Raises:
        ArgumentTypeError: The text is not a non-negative integer.
    """
    if not text.isdecimal():
        raise argparse.ArgumentTypeError(f"'{text}' is not a valid number; give an integer, 0 or more")
    return int(text)


def percentage(text: str) -> float:
    """Parse a limit in percent.

    Raises:
        ArgumentTypeError: The text is not a finite number above -100.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and value > -100.0):
        raise argparse.ArgumentTypeError(f"'{text}' is not a valid percentage; give a number above -100, for example 5")
    return value


STUDY = argument("folder", type=Path, help="the study's folder, for example results/paper, or a folder of cells")

OUTPUT_FORMAT = argument("--format", choices=("terminal", "json"), default="terminal", help="default: terminal")

RUN_PROGRAMS = flag("--run-programs", help="run programs of stored results (filter=command); only if you trust them")
"""Option to run programs that stored results name. By default, no program runs, as others may have made the results."""

EXECUTION = (
    argument("--cluster", default="local", help="cluster that runs it: local, dask, slurm, ... (default: local)"),
    argument("--workers", type=int, default=0, help="number of processes (default: one for each processor)"),
)
"""The options of commands that can run on a cluster."""

JUDGING = (
    argument("--method", metavar="FACTORS", help="factors of a method (default: filter,adaptation,noise, or attitude)"),
    argument("--margin", type=percentage, default=3.0, metavar="PCT", help="equal within PCT percent (default: 3)"),
)
"""The options of commands that compare methods."""


def judging(arguments: argparse.Namespace) -> "tuple[tuple[str, ...] | None, VerdictRule]":
    """Return the factors that define a method (None for the default factors), and the rule of the comparison.

    Raises:
        JerkbenchError: A factor is unknown, or no factor is given.
    """
    from jerkbench.report.columns import parse_method
    from jerkbench.report.comparisons import VerdictRule

    return None if arguments.method is None else parse_method(arguments.method), VerdictRule(arguments.margin / 100)
