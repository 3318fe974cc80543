"""A comparison of two sets of results, for a terminal, for a page, and for machines."""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from jerkbench.report.analysis.changes import Change, change_rows
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.tables.markdown import markdown_grid
from jerkbench.report.tables.terminal import print_grid
from jerkbench.writers.junit import Case, junit


class Compared(NamedTuple):
    """A comparison.

    Attributes:
        metric: column that was compared.
        changes: of each combination.
        varying: the factors that tell the combinations apart.
        notes: sentences below the numbers.
        fail_above: percent by which a combination may be worse; None: nobody asked.
        failed: whether one is worse than that, or cannot be judged.
    """

    metric: str
    changes: Sequence[Change]
    varying: Sequence[str]
    notes: Sequence[str]
    fail_above: float | None
    failed: bool


def print_compared(compared: Compared) -> None:
    """Print the comparison in the terminal."""
    print_grid(*_grid(compared))


def compared_markdown(compared: Compared) -> str:
    """Return the comparison as a section of Markdown."""
    return markdown_grid(*_grid(compared))


def compared_json(compared: Compared) -> str:
    """Return the comparison as JSON; what is no number is null."""
    content = {
        "metric": compared.metric,
        "fail_above_percent": compared.fail_above,
        "ok": not compared.failed,
        "changes": [_record(change, compared.fail_above) for change in compared.changes],
        "notes": list(compared.notes),
    }
    return json.dumps(content, indent=2) + "\n"


def compared_junit(compared: Compared) -> str:
    """Return the comparison as a JUnit file: a case for each combination."""
    rows = change_rows(compared.changes, compared.varying)
    return junit(
        f"jerkbench compare {compared.metric}",
        [_case(compared, change, row) for change, row in zip(compared.changes, rows, strict=True)],
    )


WRITERS: Mapping[str, Callable[[Compared], str]] = {
    "md": compared_markdown,
    "json": compared_json,
    "junit": compared_junit,
}
"""Formats that are text."""


def _grid(compared: Compared) -> tuple[str, list[str], list[list[str]], Sequence[str]]:
    header = [*compared.varying, "A", "B", "B/A", "95 %", ""]
    rows = change_rows(compared.changes, compared.varying)
    return quantity(compared.metric).heading, header, rows, compared.notes


def _record(change: Change, percent: float | None) -> dict[str, Any]:
    judgement = change.judgement
    numbers = {"a": change.means[0], "b": change.means[1], "ratio": judgement.ratio}
    numbers |= {"low": judgement.low, "high": judgement.high}
    return {
        "combination": dict(zip(FACTORS, change.combination, strict=True)),
        **{name: float(value) if math.isfinite(value) else None for name, value in numbers.items()},
        "runs": list(map(int, change.runs)),
        "lost": list(map(int, change.lost)),
        "verdict": change.verdict,
        "worse": None if percent is None else change.worse(percent),
        "judged": not change.unjudged,
    }


def _case(compared: Compared, change: Change, row: Sequence[str]) -> Case:
    names, (a, b, ratio, interval, verdict) = row[:-5], row[-5:]
    sentence = f"A has {a}, B has {b}: {ratio} {interval}, {verdict}."
    percent = compared.fail_above
    failures = []
    if percent is not None and change.worse(percent):
        failures.append(f"{sentence} That is worse by more than {percent:g} %.")
    if percent is not None and change.unjudged:
        failures.append(f"{sentence} B lacks runs of A, so that it cannot be judged.")
    return Case(compared.metric, ", ".join(names) or "all", tuple(failures), () if failures else (sentence,))
