"""Checks of parameters, each with one sentence as its error."""

import math
from collections.abc import Collection, Iterable, Mapping

from jerkbench.errors import PluginError, unknown


def require_choices(owner: object, choices: Mapping[str, Collection[str]]) -> None:
    """Raise a PluginError that names the first of the parameters whose value is none of its choices."""
    for name, available in choices.items():
        value = getattr(owner, name)
        if value not in available:
            raise PluginError(unknown(name, value, available))


def require_positive(plugin: str, owner: object, names: Iterable[str]) -> None:
    """Raise a PluginError that names the first of the parameters that is not a finite number above zero."""
    for name in names:
        value = getattr(owner, name)
        if not 0 < value < math.inf:
            raise PluginError(f"{plugin}: {name} is {value}; it must be a positive number.")


def require_not_negative(plugin: str, owner: object, names: Iterable[str]) -> None:
    """Raise a PluginError that names the first of the parameters that is below zero or not finite."""
    for name in names:
        value = getattr(owner, name)
        if not 0 <= value < math.inf:
            raise PluginError(f"{plugin}: {name} is {value}; it must be zero or positive, and finite.")


def require_axes(plugin: str, owner: object, names: Iterable[str], *, positive: bool) -> None:
    """Raise a PluginError unless each of the parameters has three finite values (above zero, if ``positive``)."""
    for name in names:
        values = getattr(owner, name)
        fits = len(values) == 3 and all(math.isfinite(v) and (v > 0 or not positive) for v in values)
        if not fits:
            kind = "positive numbers" if positive else "numbers"
            raise PluginError(f"{plugin}: {name} is {values}; it must be three {kind}, one for each axis.")


def require_multiple(plugin: str, owner: object, high: str, low: str) -> None:
    """Raise a PluginError unless the rate ``high`` is a whole multiple of the rate ``low``."""
    ratio = getattr(owner, high) / getattr(owner, low)
    if ratio < 1 or not math.isclose(ratio, round(ratio), rel_tol=1e-9):
        raise PluginError(
            f"{plugin}: {high} is {getattr(owner, high)} and {low} is {getattr(owner, low)}; the first must be a whole"
            " multiple of the second, so that their stamps coincide."
        )
