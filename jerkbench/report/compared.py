"""Two sets of results: how far one may fall behind, and the comparison as text, Markdown, JSON and JUnit."""

import json
import math
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, NamedTuple

from jerkbench.errors import JerkbenchError, unknown
from jerkbench.evaluation.statistics.intervals import loss_bound
from jerkbench.files import read_yaml
from jerkbench.plugins.requirements import JunitCase, junit
from jerkbench.report.analysis.changes import Change, change_rows
from jerkbench.report.analysis.columns import METHOD, Combination, quantity
from jerkbench.report.tables.terminal import print_grid
from jerkbench.report.tables.writers import markdown_grid

KEY = "tolerances"
"""The list in the file."""

ANY = "*"
LINE = "{metric: position_rmse_m, method: mtf, scenario: gnss_outage, ratio: 1.05}"
"""An example of a rule."""


class Tolerance(NamedTuple):
    """One rule.

    Attributes:
        ratio: B/A up to which a combination passes.
        metric: pattern (``*``, ``?``, ``[...]``) of a column of rows.csv.
        method: pattern of a filter, an adaptation or a noise, or of these joined by ``+``.
        scenario: pattern of a data set, a disturbance or an attitude, or of these joined by ``+``.
    """

    ratio: float
    metric: str = ANY
    method: str = ANY
    scenario: str = ANY

    def fits(self, metric: str, combination: Combination) -> bool:
        """Whether the rule is about this metric of this combination."""
        values = combination._asdict()
        scenario = [value for factor, value in values.items() if factor not in METHOD]
        method = [values[factor] for factor in METHOD]
        return (
            fnmatchcase(metric, self.metric) and _any_fits(method, self.method) and _any_fits(scenario, self.scenario)
        )

    @property
    def percent(self) -> float:
        """By how many percent a combination may be worse."""
        return 100 * (self.ratio - 1)


def _any_fits(values: Sequence[str], pattern: str) -> bool:
    return any(fnmatchcase(text, pattern) for text in (*values, "+".join(values)))


class Tolerances(NamedTuple):
    """All rules of a file, and what holds where none fits; the first that fits counts.

    Attributes:
        rules: in the order of the file.
        otherwise: percent where no rule fits; None: nobody asked.
    """

    rules: tuple[Tolerance, ...] = ()
    otherwise: float | None = None

    def percent(self, metric: str, combination: Combination) -> float | None:
        """Return by how many percent a combination may be worse; None: it cannot fail."""
        fitting = (rule.percent for rule in self.rules if rule.fits(metric, combination))
        return next(fitting, self.otherwise)

    def metrics(self, main: str, columns: Iterable[str]) -> list[str]:
        """Return what is to be compared: the main metric, if a rule leaves it open, and the columns that rules name."""
        named = [rule.metric for rule in self.rules if rule.metric != ANY]
        chosen = [column for column in columns if any(fnmatchcase(column, pattern) for pattern in named)]
        return chosen if named and len(named) == len(self.rules) else list(dict.fromkeys([main, *chosen]))

    def idle(self, compared: Iterable[tuple[str, Combination]]) -> list[str]:
        """Return a sentence for each rule that fits nothing that was compared."""
        pairs = list(compared)
        return [
            f"Tolerance {number} fits no combination (metric {rule.metric}, method {rule.method}, scenario "
            f"{rule.scenario})."
            for number, rule in enumerate(self.rules, start=1)
            if not any(rule.fits(*pair) for pair in pairs)
        ]


def read_tolerances(path: Path, otherwise: float | None = None) -> Tolerances:
    """Read a file of tolerances: YAML, or TOML if its name ends so.

    Raises:
        JerkbenchError: it cannot be read, or a rule is none.
    """
    import yaml

    try:
        content = tomllib.loads(path.read_text(encoding="utf-8")) if path.suffix == ".toml" else read_yaml(path)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, yaml.YAMLError) as error:
        raise JerkbenchError(f"{path} cannot be read: {' '.join(str(error).split())}.") from error
    rules = content.get(KEY) if isinstance(content, Mapping) and set(content) == {KEY} else None
    if not isinstance(rules, list) or not rules:
        raise JerkbenchError(f"{path} has no list of tolerances: write {KEY}:, and below it lines as - {LINE}.")
    return Tolerances(tuple(_rule(path, number, rule) for number, rule in enumerate(rules, start=1)), otherwise)


def _rule(path: Path, number: int, rule: object) -> Tolerance:
    where = f"{path}, tolerance {number}"
    if not isinstance(rule, Mapping):
        raise JerkbenchError(f"{where} is {rule!r}; write it as {LINE}.")
    known = ("metric", "method", "scenario", "ratio")
    for key in rule:
        if key not in known:
            raise JerkbenchError(f"{where}: {unknown('key', str(key), known)}")
    ratio = rule.get("ratio")
    if isinstance(ratio, bool) or not isinstance(ratio, int | float) or not 0 < ratio < math.inf:
        raise JerkbenchError(f"{where}: ratio is {ratio!r}; it must be a number above 0, 1.05 for 5 % worse at most.")
    return Tolerance(float(ratio), **{key: str(value) for key, value in rule.items() if key != "ratio"})


# A comparison of two sets of results, for a terminal, for a page, and for machines.


class MetricChanges(NamedTuple):
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


class StudyComparison(NamedTuple):
    """A comparison by one metric or several.

    Attributes:
        parts: by each metric.
        notes: sentences below the numbers.
        failed: whether a combination is worse than it may be, or cannot be judged.
    """

    parts: Sequence[MetricChanges]
    notes: Sequence[str]
    failed: bool


def print_comparison(comparison: StudyComparison) -> None:
    """Print the comparison in the terminal."""
    for grid in _grids(comparison):
        print_grid(*grid)


def comparison_json(comparison: StudyComparison) -> str:
    """Return the comparison as JSON; what is no number is null."""
    content = {
        "metrics": [part.metric for part in comparison.parts],
        "ok": not comparison.failed,
        "changes": [record for part in comparison.parts for record in _records(part)],
        "notes": list(comparison.notes),
    }
    return json.dumps(content, indent=2) + "\n"


WRITERS: Mapping[str, Callable[[StudyComparison], str]] = {
    "md": lambda comparison: "\n".join(markdown_grid(*grid) for grid in _grids(comparison)),
    "json": comparison_json,
    "junit": lambda comparison: junit(
        f"jerkbench compare {', '.join(part.metric for part in comparison.parts)}",
        [case for part in comparison.parts for case in _cases(part)],  # one for each combination and metric
    ),
}
"""Formats that are text."""


def _grids(comparison: StudyComparison) -> Iterator[tuple[str, list[str], list[list[str]], Sequence[str]]]:
    """The table of each metric; the notes stand below the last."""
    for part in comparison.parts:
        notes = comparison.notes if part is comparison.parts[-1] else ()
        yield quantity(part.metric).heading, *_grid(part), notes


def _grid(part: MetricChanges) -> tuple[list[str], list[list[str]]]:
    """A column says what is allowed, where it is not the same for all."""
    header, rows = [*part.varying, "A", "B", "B/A", "95 %", "losses", ""], change_rows(part.changes, part.varying)
    for row, worse in zip(rows, part.worse, strict=True):
        row[-1] += ", too much" if worse else ""
    if len(set(part.allowed)) <= 1:
        return header, rows
    allowed = ["" if percent is None else f"×{1 + percent / 100:g}" for percent in part.allowed]  # noqa: RUF001
    return [*header[:-1], "allowed", ""], [[*row[:-1], may, row[-1]] for row, may in zip(rows, allowed, strict=True)]


def _records(part: MetricChanges) -> Iterator[dict[str, Any]]:
    for change, percent, worse in zip(part.changes, part.allowed, part.worse, strict=True):
        judgement = change.judgement
        numbers = {"a": change.means[0], "b": change.means[1], "ratio": judgement.ratio}
        numbers |= {"low": judgement.low, "high": judgement.high}
        yield {
            "metric": part.metric,
            "combination": change.combination._asdict(),
            **{name: float(value) if math.isfinite(value) else None for name, value in numbers.items()},
            "runs": list(map(int, change.runs)),
            "lost": list(map(int, change.lost)),
            "lost_up_to": list(map(loss_bound, change.lost, change.runs)),
            "verdict": change.verdict,
            "allowed_percent": percent,
            "worse": None if percent is None else worse,
            "judged": not change.unjudged,
        }


def _cases(part: MetricChanges) -> Iterator[JunitCase]:
    rows = change_rows(part.changes, part.varying)
    for change, row, percent, worse in zip(part.changes, rows, part.allowed, part.worse, strict=True):
        names, (a, b, ratio, interval, lost, verdict) = row[:-6], row[-6:]
        sentence = f"A has {a}, B has {b}: {ratio} {interval}, {verdict}{f'; {lost}' if lost else ''}."
        failures = [f"{sentence} That is worse by more than {percent:g} %."] if worse else []
        if percent is not None and change.unjudged:
            failures.append(f"{sentence} B lacks runs of A, so that it cannot be judged.")
        yield JunitCase(part.metric, ", ".join(names) or "all", tuple(failures), () if failures else (sentence,))
