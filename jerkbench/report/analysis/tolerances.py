"""Tolerances: by how much which metric of which method may be worse in which scenario, as a file says."""

import math
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from jerkbench.errors import JerkbenchError, unknown
from jerkbench.report.analysis.factors import FACTORS, METHOD
from jerkbench.report.analysis.runs import Combination
from jerkbench.yaml_files import read_yaml

KEY = "tolerances"
"""The list in the file."""

ANY = "*"
LINE = "{metric: position_rmse_m, method: mtf, scenario: gnss_outage, ratio: 1.05}"
"""An example of a rule."""


@dataclass(frozen=True)
class Tolerance:
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
        values = dict(zip(FACTORS, combination, strict=True))
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


@dataclass(frozen=True)
class Tolerances:
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
    content = _content(path)
    rules = content.get(KEY) if isinstance(content, Mapping) and set(content) == {KEY} else None
    if not isinstance(rules, list) or not rules:
        raise JerkbenchError(f"{path} has no list of tolerances: write {KEY}:, and below it lines as - {LINE}.")
    return Tolerances(tuple(_rule(path, number, rule) for number, rule in enumerate(rules, start=1)), otherwise)


def _content(path: Path) -> Any:  # noqa: ANN401 - whatever stands there
    import yaml

    try:
        return tomllib.loads(path.read_text(encoding="utf-8")) if path.suffix == ".toml" else read_yaml(path)
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, yaml.YAMLError) as error:
        raise JerkbenchError(f"{path} cannot be read: {' '.join(str(error).split())}.") from error


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
