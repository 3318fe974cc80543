"""The options that say how a study's methods are judged, alike for every verb that judges."""

import argparse
from typing import TYPE_CHECKING

from jerkbench.verbs.arguments import percentage

if TYPE_CHECKING:
    from jerkbench.report.analysis.rule import Rule


def add_judging(parser: argparse.ArgumentParser) -> None:
    """Declare ``--method``, ``--margin`` and ``--correction``."""
    parser.add_argument(
        "--method",
        metavar="FACTORS",
        help="what a method is made of (default: filter,adaptation,noise; the attitude where it alone varies); "
        "the rest makes a scenario",
    )
    parser.add_argument(
        "--margin",
        type=percentage,
        default=3.0,
        metavar="PCT",
        help="methods within PCT percent are equal (default: 3)",
    )
    parser.add_argument(
        "--correction",
        choices=("max_t", "fdr"),
        default="max_t",
        help="5 %% of studies with any wrong sentence (max_t, the default), or of sentences (fdr)",
    )


def chosen_rule(chosen: argparse.Namespace) -> "Rule":
    """Return the rule that was asked for."""
    from jerkbench.evaluation.statistics.multiplicity import Correction
    from jerkbench.report.analysis.rule import Rule

    return Rule(chosen.margin / 100, Correction(chosen.correction))


def chosen_method(chosen: argparse.Namespace) -> tuple[str, ...] | None:
    """Return the factors of a method; None where none was asked for.

    Raises:
        JerkbenchError: there is no such factor, or none.
    """
    from jerkbench.report.analysis.factors import parse_method

    return parse_method(chosen.method) if chosen.method is not None else None
