"""The combination that each one is held against: like it but for some factors."""

from collections.abc import Collection, Iterable, Mapping

from jerkbench.errors import JerkbenchError, unknown
from jerkbench.report.analysis.factors import FACTORS
from jerkbench.report.analysis.runs import Combination


def parse_baseline(text: str) -> dict[str, str]:
    """Read ``factor=value[;factor=value]`` (a comma does as well, where no value has one).

    Raises:
        JerkbenchError: it is not of that form, or names no factor.
    """
    parts = text.split(";") if ";" in text else text.split(",") if text.count("=") > 1 and "(" not in text else [text]
    values = {}
    for part in parts:
        key, equals, value = (word.strip() for word in part.partition("="))
        if not equals or not value:
            raise JerkbenchError(f"The baseline '{text}' is not of the form FACTOR=NAME, for example adaptation=none.")
        if key not in FACTORS:
            raise JerkbenchError(unknown("factor", key, FACTORS))
        values[key] = value
    return values


def partners(
    combinations: Collection[Combination], baseline: Mapping[str, str]
) -> list[tuple[Combination, Combination]]:
    """Return every combination with the one that is like it but for the factors of ``baseline``.

    What has no such partner, or is the partner itself, is left out.

    Raises:
        JerkbenchError: no combination has the values of the baseline.
    """
    pairs = [(key, with_values(key, baseline)) for key in combinations]
    if not any(partner in combinations for _, partner in pairs):
        raise JerkbenchError(_no_baseline(combinations, baseline))
    return [(key, partner) for key, partner in pairs if partner in combinations and partner != key]


def with_values(combination: Combination, values: Mapping[str, str]) -> Combination:
    """Return the combination with some of its factors replaced."""
    return tuple(values.get(key, value) for key, value in zip(FACTORS, combination, strict=True))


def _no_baseline(combinations: Iterable[Combination], baseline: Mapping[str, str]) -> str:
    labels = {factor: set(values) for factor, values in zip(FACTORS, zip(*combinations, strict=True), strict=True)}
    key, value = next(((k, v) for k, v in baseline.items() if v not in labels[k]), next(iter(baseline.items())))
    if value in labels[key]:
        factors = ", ".join(f"{k}={v}" for k, v in baseline.items())
        return f"No combination has {factors} together; `jerkbench table DIR` shows those that there are."
    return unknown(key, value, labels[key])
