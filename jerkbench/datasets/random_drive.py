"""Random drives: a simulated data set whose parameters and faults are drawn from the seed, by laws in words."""

import dataclasses
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, ClassVar, NamedTuple

import numpy as np

from jerkbench import plugins
from jerkbench.errors import PluginError, unknown
from jerkbench.plugins import register
from jerkbench.random_streams import stream
from jerkbench.recording import Recording


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
FORMS: Mapping[str, Callable[..., Any]] = {
    "always VALUE": lambda _, value: value,
    "uniform LOW to HIGH": lambda random, low, high: random.uniform(low, high),
    "log_uniform LOW to HIGH": _log_uniform,
    "log_normal MEDIAN sigma S": _log_normal,
    "times COUNT in BEGIN to END": _times,
    "windows FEWEST to MOST of SHORTEST to LONGEST in BEGIN to END": _windows,
}
"""How each law is written, its numbers in capitals, and how it is drawn; besides, ``one_of WORD WORD ...``.

S is the standard deviation of the natural logarithm. Windows do not overlap.
"""


class Law(NamedTuple):
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
    for form, sampler in FORMS.items():
        if found := re.fullmatch(re.sub("[A-Z]+", lambda _: N, form), written):
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


@register("dataset", "random_drive")
@dataclass(frozen=True)
class RandomDrive:
    """A simulated drive whose parameters and faults are drawn from the seed, by laws that a preset states.

    Each seed is another drive, so that a sweep over seeds is a sweep over drives: a draw is one drive, for which each
    parameter has got one random value by its law. A law is a line of text::

        speed_mps ~ uniform 0.9 to 2.2          roughness ~ log_normal 1.5 sigma 0.4    (median; sigma of the logarithm)
        size_m ~ log_uniform 0.5 to 10          trace ~ one_of comma2k19 pixel4 tokyo_1105
        times_s ~ times 2 in 15 to 145          windows_s ~ windows 1 to 3 of 2 to 10 in 15 to 145
        duration_s ~ always 60                  gyro_radps = accel_mps2 * 0.025         (of one that is drawn before)

    Windows are uniform in number, length and place, and do not overlap. The unit of a parameter ends its name.

    A drive has 0, 1, 2 ... faults with the given probabilities. Their kinds are drawn without replacement, all alike,
    and act in the order in which they are listed. The preset `mixture` states the laws of the audit.

    Each parameter has a random stream of its own. The drive is the one that the data set and the disturbances give by
    themselves with the drawn parameters and the same seed. What was drawn stands in each row of a study, in columns
    that begin with ``drawn.``: numbers as they are, a word as ``drawn.trace.pixel4 = 1``, a tuple by the places of its
    numbers, the kinds of faults as ``drawn.fault.outliers = 1``, and their number as ``drawn.faults``.

    Attributes:
        bases: simulated data sets, of which one is drawn.
        drive: laws of the data set's parameters.
        fault_shares: probability of 0, 1, 2 ... faults.
        faults: kinds of faults: the name of a disturbance, or of a switch of the data set (``ruts``), and the laws of
            its parameters.
    """

    seeded: ClassVar[bool] = True

    bases: tuple[str, ...] = ("field",)
    drive: tuple[str, ...] = ()
    fault_shares: tuple[float, ...] = (1.0,)
    faults: tuple[tuple[str, ...], ...] = ()

    def __post_init__(self) -> None:
        """Check that every name exists, every law can be drawn from, and the probabilities are some."""
        for base in self.bases:
            if not getattr(plugins.get("dataset", base), "seeded", False) or base == "random_drive":
                raise PluginError(
                    f"random_drive: {base} is no simulated data set, so that nothing can be drawn for it."
                )
        shares = np.array(self.fault_shares)
        if not self.bases or (shares < 0).any() or abs(shares.sum() - 1) > 1e-9 or len(shares) > len(self.faults) + 1:
            raise PluginError(
                f"random_drive: fault_shares is {self.fault_shares} for {len(self.faults)} kinds of faults and the data"
                f" sets {self.bases}; give probabilities whose sum is 1, at most one more than kinds, and a data set."
            )
        for kind, laws in ("", self.drive), *((kind, laws) for kind, *laws in self.faults):
            owners = [("dataset", base) for base in self.bases] if self._of_drive(kind) else [("disturbance", kind)]
            for owner in owners:
                known = [f.name for f in dataclasses.fields(plugins.get(*owner))]
                for wrong in (law(text).parameter for text in laws if law(text).parameter not in known):
                    raise PluginError(unknown(f"parameter of {' '.join(owner)}", wrong, known))

    def load(self, seed: int) -> Recording:
        """Return the drive that belongs to ``seed``."""
        base, drive, faults = self.drawn(seed)
        switched = [{kind: True, **own} for kind, own in faults.items() if self._of_drive(kind)]
        parameters = {name: value for own in (drive, *switched) for name, value in own.items()}
        recording: Recording = plugins.create("dataset", {"name": base, **parameters}).load(seed)
        for kind, own in faults.items():
            if not self._of_drive(kind):
                recording = plugins.create("disturbance", {"name": kind, **own}).apply(recording, seed)
        return replace(recording, parameters=self.columns(seed), drawn=None if faults else recording.drawn)

    def fingerprint(self) -> str:
        """Return the empty string: it reads no data."""
        return ""

    def drawn(self, seed: int) -> tuple[str, dict[str, Any], dict[str, dict[str, Any]]]:
        """Return what ``seed`` draws: the data set, its parameters, and the parameters of each fault by its kind."""
        base = self.bases[stream(seed, "random_drive", "base").integers(len(self.bases))]
        random = stream(seed, "random_drive", "faults")
        count = random.choice(len(self.fault_shares), p=self.fault_shares)
        kinds = sorted(random.permutation(len(self.faults))[:count])
        faults = {kind: _values(seed, kind, laws) for kind, *laws in (self.faults[place] for place in kinds)}
        return base, _values(seed, "", self.drive), faults

    def columns(self, seed: int) -> dict[str, float]:
        """Return what ``seed`` draws as the columns that a study's rows have."""
        base, drive, faults = self.drawn(seed)
        return dict(_numbers("drawn", {"base": base, **drive, "faults": len(faults), "fault": [*faults], **faults}))

    def _of_drive(self, kind: str) -> bool:
        """Whether the parameters of a kind of faults are the data set's: those of none, and of one of its switches."""
        bases = [plugins.get("dataset", base) for base in self.bases]
        return not kind or all(isinstance(getattr(base, kind, None), bool) for base in bases)


def _values(seed: int, kind: str, laws: Sequence[str]) -> dict[str, Any]:
    """Draw the parameters of a kind of faults; of none, the data set's."""
    values: dict[str, Any] = {}
    for each in map(law, laws):
        values[each.parameter] = each.draw(stream(seed, "random_drive", kind, each.parameter), values)
    return values


def _numbers(name: str, value: Any) -> Iterator[tuple[str, float]]:  # noqa: ANN401 - whatever a parameter may be
    """Yield the columns of what was drawn."""
    if isinstance(value, (int, float)):
        yield name, float(value)
    elif isinstance(value, str):
        yield f"{name}.{value}", 1.0
    elif isinstance(value, Mapping):
        for key, own in value.items():
            yield from _numbers(f"{name}.{key}", own)
    else:
        for place, own in enumerate(value):
            yield from _numbers(name if isinstance(own, str) else f"{name}.{place}", own)
