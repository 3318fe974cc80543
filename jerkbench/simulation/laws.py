"""Laws that parameters of a random drive are drawn from, as one writes them: ``speed_mps ~ uniform 0.9 to 2.2``."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from jerkbench.errors import PluginError, unknown


def _log_uniform(random: np.random.Generator, low: float, high: float) -> float:
    return math.exp(random.uniform(math.log(low), math.log(high)))


def _log_normal(random: np.random.Generator, median: float, sigma: float) -> float:
    return median * math.exp(sigma * random.standard_normal())


def _times(random: np.random.Generator, count: float, begin: float, end: float) -> tuple[float, ...]:
    return tuple(np.sort(random.uniform(begin, end, int(count))).tolist())


def _windows(
    random: np.random.Generator, fewest: float, most: float, shortest: float, longest: float, begin: float, end: float
) -> tuple[tuple[float, float], ...]:
    """Number and lengths are uniform; the time that is left over is cut at random into the gaps between them."""
    count = int(random.integers(int(fewest), int(most), endpoint=True))
    lengths = random.uniform(shortest, longest, count)
    cuts = np.sort(random.uniform(size=count))
    begins = begin + cuts * (end - begin - lengths.sum()) + np.cumsum(lengths) - lengths
    return tuple(zip(begins.tolist(), (begins + lengths).tolist(), strict=True))


def _one_of(random: np.random.Generator, *words: str) -> str:
    return words[random.integers(len(words))]


def _scaled(other: float, *factors: float) -> float | tuple[float, ...]:
    values = tuple(factor * other for factor in factors)
    return values if len(values) > 1 else values[0]


N = r"([-+.\deE]+)"
FORMS: Mapping[str, tuple[str, Callable[..., Any]]] = {
    "always VALUE": (N, lambda _, value: value),
    "uniform LOW to HIGH": (f"{N} to {N}", lambda random, low, high: random.uniform(low, high)),
    "log_uniform LOW to HIGH": (f"{N} to {N}", _log_uniform),
    "log_normal MEDIAN sigma S": (f"{N} sigma {N}", _log_normal),
    "times COUNT in BEGIN to END": (f"{N} in {N} to {N}", _times),
    "windows FEWEST to MOST of SHORTEST to LONGEST in BEGIN to END": (
        f"{N} to {N} of {N} to {N} in {N} to {N}",
        _windows,
    ),
}
"""How each law is written, the pattern of its numbers, and how it is drawn; besides, ``one_of WORD WORD ...``.

S is the standard deviation of the natural logarithm. Windows do not overlap.
"""


@dataclass(frozen=True)
class Law:
    """The law of one parameter.

    Attributes:
        parameter: its name.
        sampler: from a random generator, or from the value of ``other``, and the arguments to a value.
        arguments: numbers, or words.
        other: the parameter that it follows; empty: it is random itself.
    """

    parameter: str
    sampler: Callable[..., Any]
    arguments: Sequence[Any]
    other: str = ""

    def draw(self, random: np.random.Generator, drawn: Mapping[str, Any]) -> Any:  # noqa: ANN401 - as the parameter
        """Return a value; ``drawn`` has those of the parameters before."""
        return self.sampler(drawn[self.other] if self.other else random, *self.arguments)


@cache
def law(text: str) -> Law:
    """Read ``parameter ~ law``, or ``parameter = other * factor ...`` of a parameter that is drawn before.

    Raises:
        PluginError: it is no law, or its numbers make no sense; says which laws there are.
    """
    if scaled := re.fullmatch(rf"(\w+) = (\w+) \*((?: {N})+)", text):
        return Law(scaled[1], _scaled, _floats(text, scaled[3].split()), scaled[2])
    parameter, _, written = text.partition(" ~ ")
    name, _, rest = written.partition(" ")
    if name == "one_of" and rest.split():
        return Law(parameter, _one_of, rest.split())
    for form, (pattern, sampler) in FORMS.items():
        if form.split()[0] == name and (found := re.fullmatch(pattern, rest)):
            return Law(parameter, sampler, _checked(text, form, _floats(text, found.groups())))
    raise PluginError(unknown("law", text, [f"NAME ~ {form}" for form in (*FORMS, "one_of WORD ...")]))


def _floats(text: str, words: Sequence[str]) -> list[float]:
    try:
        return [float(word) for word in words]
    except ValueError as error:
        raise PluginError(f"The law '{text}' has a number that is none: {error}.") from error


def _checked(text: str, form: str, numbers: list[float]) -> list[float]:
    """Refuse ranges that are upside down, logarithms of nothing, and windows for which there is no room."""
    named = dict(zip(re.findall("[A-Z]+", form), numbers, strict=True))
    pairs = [("LOW", "HIGH"), ("FEWEST", "MOST"), ("SHORTEST", "LONGEST"), ("BEGIN", "END")]
    wrong = any(low in named and named[low] > named[high] for low, high in pairs)
    wrong |= form.startswith("log") and numbers[0] <= 0
    wrong |= min(named.get(name, 0.0) for name in ("S", "FEWEST", "COUNT", "SHORTEST")) < 0
    if wrong or named.get("MOST", 0.0) * named.get("LONGEST", 0.0) > named.get("END", 0.0) - named.get("BEGIN", 0.0):
        raise PluginError(f"The law '{text}' cannot be drawn from: give {form}, low before high, with room for all.")
    return numbers
