"""The declaration of a verb, the words that several verbs take, and the examples of each."""

import argparse
import json
import math
from collections.abc import Callable, Mapping, Sequence
from itertools import groupby
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

from jerkbench.errors import JerkbenchError

if TYPE_CHECKING:
    from jerkbench.report.analysis.runs import VerdictRule

    Parsers = argparse._SubParsersAction[argparse.ArgumentParser]  # noqa: SLF001 - argparse has no public name for it

Argument = tuple[tuple[str, ...], dict[str, Any]]
"""What `argparse.ArgumentParser.add_argument` takes."""

Answering = Callable[[argparse.Namespace], None]

Declaration = Callable[["Parsers"], None]


def verb(*arguments: Argument, epilog: str = "") -> Callable[[Answering], Declaration]:
    """Make a verb of the function that answers it: ``data_convert_verb`` of ``convert``, titled as it is documented."""

    def declaration(answer: Answering) -> Declaration:
        name = answer.__name__.removesuffix("_verb").rpartition("_")[2]
        title = str(answer.__doc__).partition("\n")[0]

        def declare(parsers: "Parsers") -> None:
            help_line = f"{title[0].lower()}{title[1:-1]}"
            parser = parsers.add_parser(name, help=help_line, description=title)
            parser.epilog = epilog_of(parser.prog.removeprefix("jerkbench "), epilog)
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
    argument(
        "--correction",
        choices=("max_t", "fdr"),
        default="max_t",
        help="5 %% of studies with any wrong sentence (max_t, the default), or of sentences (fdr)",
    ),
)
"""How a study's methods are judged."""


def chosen_rule(chosen: argparse.Namespace) -> "VerdictRule":
    """Return the rule that was asked for."""
    from jerkbench.evaluation.statistics.families import Correction
    from jerkbench.report.analysis.runs import VerdictRule

    return VerdictRule(chosen.margin / 100, Correction(chosen.correction))


def chosen_method(chosen: argparse.Namespace) -> tuple[str, ...] | None:
    """Return the factors of a method; None where none was asked for.

    Raises:
        JerkbenchError: there is no such factor, or none.
    """
    from jerkbench.report.analysis.columns import parse_method

    return parse_method(chosen.method) if chosen.method is not None else None


# What `--help` of a verb ends with.

EXAMPLE_LINES = """\
jerkbench list adaptation
jerkbench list metric --format json
jerkbench show adaptation mtf
jerkbench show filter jerk --format json
jerkbench table results/first --baseline adaptation=none
jerkbench table results/first --metric velocity_rmse_mps --rows disturbance --columns filter --format md
jerkbench table results/first --findings --all
jerkbench figures results/first --scenarios none --methods baseline,jerk+mtf
jerkbench figures results/first --scenarios 0 --pdf --out paper
jerkbench report results/first --figures none
jerkbench report results/first --scenarios 1 --out first.html
jerkbench rerun results/first 1
jerkbench rerun results/first 12
jerkbench export results/first 1 --tum trajectories
jerkbench export results/first 5 --updates updates.csv
jerkbench pack results/first
jerkbench pack results/first/cells
jerkbench cite
jerkbench cite results/first
jerkbench new adaptation my_rule
jerkbench new filter my_model --out packages/my_model
jerkbench check my_rule
jerkbench check packages/my_model --format junit
jerkbench data convert field drive.bag --set duration_s=30
jerkbench data convert drive.bag drive.csv --coordinates ned
jerkbench data inspect drive.bag --figure overview.png
jerkbench data inspect field --set duration_s=30 --seed 1
jerkbench data receiver drive.bag --figure receiver.png
jerkbench data receiver field --set duration_s=60 --seed 1
jerkbench smooth ride.gpx --to smooth.gpx --figure smooth.png
jerkbench smooth field --set duration_s=60 --to kml
jerkbench data salvage cut.bag whole.bag
jerkbench data salvage drive.bag.active saved.bag
jerkbench data fetch
jerkbench data fetch broad
jerkbench data trace field errors.parquet --set duration_s=30
jerkbench data trace field biased.parquet --set duration_s=30 --offset keep
jerkbench data cache
jerkbench data cache --clear
jerkbench completion bash
jerkbench completion zsh
jerkbench suite verify results/suite-tiny/jerk-none
jerkbench suite verify results/suite-tiny/jerk-none --rows 2
jerkbench suite board results/suite-tiny
jerkbench suite board results/suite-tiny --rows 1
"""
"""The examples of one verb follow each other."""


def verb_of(line: str) -> str:
    """Return the words of the verb of a command: ``data fetch`` of ``jerkbench data fetch broad``."""
    first, *others = line.split()[1:]
    return f"{first} {others[0]}" if first in ("data", "suite") else first


VERB_EXAMPLES: Mapping[str, Sequence[str]] = {
    verb: tuple(lines) for verb, lines in groupby(EXAMPLE_LINES.splitlines(), verb_of)
}
"""By the words of the verb."""


def epilog_of(verb: str, text: str) -> str:
    """Return what `--help` of a verb ends with: its text, and its examples."""
    words = text.strip("\n") if "\n" in text else fill(text, 116)
    return "\n\n".join(filter(None, (words, "\n".join(f"  {line}" for line in VERB_EXAMPLES.get(verb, ())))))
