"""A comparison of two sets of results, for a terminal, for a page, and for machines."""

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from jerkbench.conformance.junit import JunitCase, junit
from jerkbench.evaluation.statistics.intervals import loss_bound
from jerkbench.report.analysis.changes import Change, change_rows
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.quantities import quantity
from jerkbench.report.tables.terminal import print_grid
from jerkbench.report.tables.writers import markdown_grid


class Compared(NamedTuple):
    """A comparison by one metric.

    Attributes:
        metric: column that was compared.
        changes: of each combination.
        varying: the factors that tell the combinations apart.
        allowed: of each change, percent by which it may be worse; None: nobody asked.
    """

    metric: str
    changes: Sequence[Change]
    varying: Sequence[str]
    allowed: Sequence[float | None]

    @property
    def worse(self) -> list[bool]:
        """Whether each change is worse than it may be."""
        pairs = zip(self.changes, self.allowed, strict=True)
        return [percent is not None and change.worse(percent) for change, percent in pairs]


class Comparison(NamedTuple):
    """A comparison by one metric or several.

    Attributes:
        parts: by each metric.
        notes: sentences below the numbers.
        failed: whether a combination is worse than it may be, or cannot be judged.
    """

    parts: Sequence[Compared]
    notes: Sequence[str]
    failed: bool


def print_comparison(comparison: Comparison) -> None:
    """Print the comparison in the terminal."""
    for grid in _grids(comparison):
        print_grid(*grid)


def comparison_markdown(comparison: Comparison) -> str:
    """Return the comparison as sections of Markdown."""
    return "\n".join(markdown_grid(*grid) for grid in _grids(comparison))


def comparison_json(comparison: Comparison) -> str:
    """Return the comparison as JSON; what is no number is null."""
    content = {
        "metrics": [part.metric for part in comparison.parts],
        "ok": not comparison.failed,
        "changes": [record for part in comparison.parts for record in _records(part)],
        "notes": list(comparison.notes),
    }
    return json.dumps(content, indent=2) + "\n"


def comparison_junit(comparison: Comparison) -> str:
    """Return the comparison as a JUnit file: a case for each combination and metric."""
    title = f"jerkbench compare {', '.join(part.metric for part in comparison.parts)}"
    return junit(title, [case for part in comparison.parts for case in _cases(part)])


WRITERS: Mapping[str, Callable[[Comparison], str]] = {
    "md": comparison_markdown,
    "json": comparison_json,
    "junit": comparison_junit,
}
"""Formats that are text."""


def _grids(comparison: Comparison) -> Iterator[tuple[str, list[str], list[list[str]], Sequence[str]]]:
    """The table of each metric; the notes stand below the last."""
    for part in comparison.parts:
        notes = comparison.notes if part is comparison.parts[-1] else ()
        yield quantity(part.metric).heading, *_grid(part), notes


def _grid(part: Compared) -> tuple[list[str], list[list[str]]]:
    """A column says what is allowed, where it is not the same for all."""
    header, rows = [*part.varying, "A", "B", "B/A", "95 %", "losses", ""], change_rows(part.changes, part.varying)
    for row, worse in zip(rows, part.worse, strict=True):
        row[-1] += ", too much" if worse else ""
    if len(set(part.allowed)) <= 1:
        return header, rows
    allowed = ["" if percent is None else f"×{1 + percent / 100:g}" for percent in part.allowed]  # noqa: RUF001
    return [*header[:-1], "allowed", ""], [[*row[:-1], may, row[-1]] for row, may in zip(rows, allowed, strict=True)]


def _records(part: Compared) -> Iterator[dict[str, Any]]:
    for change, percent, worse in zip(part.changes, part.allowed, part.worse, strict=True):
        judgement = change.judgement
        numbers = {"a": change.means[0], "b": change.means[1], "ratio": judgement.ratio}
        numbers |= {"low": judgement.low, "high": judgement.high}
        yield {
            "metric": part.metric,
            "combination": dict(zip(FACTORS, change.combination, strict=True)),
            **{name: float(value) if math.isfinite(value) else None for name, value in numbers.items()},
            "runs": list(map(int, change.runs)),
            "lost": list(map(int, change.lost)),
            "lost_up_to": list(map(loss_bound, change.lost, change.runs)),
            "verdict": change.verdict,
            "allowed_percent": percent,
            "worse": None if percent is None else worse,
            "judged": not change.unjudged,
        }


def _cases(part: Compared) -> Iterator[JunitCase]:
    rows = change_rows(part.changes, part.varying)
    for change, row, percent, worse in zip(part.changes, rows, part.allowed, part.worse, strict=True):
        names, (a, b, ratio, interval, lost, verdict) = row[:-6], row[-6:]
        sentence = f"A has {a}, B has {b}: {ratio} {interval}, {verdict}{f'; {lost}' if lost else ''}."
        failures = [f"{sentence} That is worse by more than {percent:g} %."] if worse else []
        if percent is not None and change.unjudged:
            failures.append(f"{sentence} B lacks runs of A, so that it cannot be judged.")
        yield JunitCase(part.metric, ", ".join(names) or "all", tuple(failures), () if failures else (sentence,))
