"""Random drives: simulated data sets whose parameters and faults are drawn from distributions in text form."""

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


def _times(random: np.random.Generator, count: float, begin: float, end: float) -> tuple[float, ...]:
    return tuple(np.sort(random.uniform(begin, end, int(count))).tolist())


def _windows(
    random: np.random.Generator, low: float, high: float, shortest: float, longest: float, begin: float, end: float
) -> tuple[tuple[float, float], ...]:
    """Draw time windows whose number and lengths are uniformly distributed.

    The time outside the windows is divided at random into the gaps between the windows.
    """
    count = int(random.integers(int(low), int(high), endpoint=True))
    lengths = random.uniform(shortest, longest, count)
    cuts = np.sort(random.uniform(size=count))
    begins = begin + cuts * (end - begin - lengths.sum()) + np.cumsum(lengths) - lengths
    return tuple(zip(begins.tolist(), (begins + lengths).tolist(), strict=True))


def _scaled(other: float, *factors: float) -> float | tuple[float, ...]:
    values = tuple(factor * other for factor in factors)
    return values if len(values) > 1 else values[0]


N = r"([-+.\deE]+)"
FORMS: Mapping[str, Callable[..., Any]] = {
    "always VALUE": lambda _, value: value,
    "uniform LOW to HIGH": lambda random, low, high: random.uniform(low, high),
    "log_uniform LOW to HIGH": lambda random, low, high: math.exp(random.uniform(math.log(low), math.log(high))),
    "log_normal MEDIAN sigma S": lambda random, median, sigma: median * math.exp(sigma * random.standard_normal()),
    "times COUNT in BEGIN to END": _times,
    "windows MIN_COUNT to MAX_COUNT of MIN_LENGTH to MAX_LENGTH in BEGIN to END": _windows,
}
"""The text of each distribution, with words in capitals as placeholders for numbers, and its sampler.

In addition, there is the distribution ``one_of A B ...``. S is the standard deviation of the natural logarithm. Windows
do not overlap.
"""

_NUMBER = r"\b[A-Z][A-Z_]*\b"
"""A placeholder for a number in the text of a distribution."""


class ParameterDistribution(NamedTuple):
    """The distribution of one parameter.

    Attributes:
        parameter: name of the parameter.
        sampler: function that returns a value of the parameter. The function is called with a random generator (or with
            the value of ``other``) and with ``arguments``.
        arguments: numbers or strings that are passed to the sampler.
        other: name of another parameter from which the value is computed, or empty for a random value.
    """

    parameter: str
    sampler: Callable[..., Any]
    arguments: Sequence[Any]
    other: str = ""

    def draw(self, random: np.random.Generator, drawn: Mapping[str, Any]) -> Any:  # noqa: ANN401 - as the parameter
        """Return a value of the parameter. ``drawn`` contains the values of the parameters that were drawn before."""
        return self.sampler(drawn[self.other] if self.other else random, *self.arguments)


@cache
def parse_distribution(text: str) -> ParameterDistribution:
    """Parse ``parameter ~ distribution`` or ``parameter = previous * factor ...`` with a previous parameter.

    Raises:
        PluginError: the distribution is unknown, or its numbers are invalid.
    """
    if scaled := re.fullmatch(rf"(\w+) = (\w+) \*((?: {N})+)", text):
        return ParameterDistribution(scaled[1], _scaled, _floats(text, scaled[3].split()), scaled[2])
    parameter, _, written = text.partition(" ~ ")
    name, _, rest = written.partition(" ")
    if name == "one_of" and rest.split():
        choices = rest.split()
        return ParameterDistribution(parameter, lambda random: choices[random.integers(len(choices))], ())
    for form, sampler in FORMS.items():
        if found := re.fullmatch(re.sub(_NUMBER, lambda _: N, form), written):
            return ParameterDistribution(parameter, sampler, _checked(text, form, _floats(text, found.groups())))
    raise PluginError(unknown("distribution", text, [f"NAME ~ {form}" for form in (*FORMS, "one_of A B ...")]))


def _floats(text: str, fields: Sequence[str]) -> list[float]:
    try:
        return [float(field) for field in fields]
    except ValueError as error:
        raise PluginError(f"The distribution '{text}' has an invalid number: {error}.") from error


def _checked(text: str, form: str, numbers: list[float]) -> list[float]:
    """Reject inverted ranges, logarithms of non-positive numbers, and windows that do not fit into the interval."""
    named = dict(zip(re.findall(_NUMBER, form), numbers, strict=True))
    pairs = [("LOW", "HIGH"), ("MIN_COUNT", "MAX_COUNT"), ("MIN_LENGTH", "MAX_LENGTH"), ("BEGIN", "END")]
    wrong = any(low in named and named[low] > named[high] for low, high in pairs)
    wrong |= form.startswith("log") and numbers[0] <= 0
    wrong |= min(named.get(name, 0.0) for name in ("S", "MIN_COUNT", "COUNT", "MIN_LENGTH")) < 0
    length = named.get("MAX_COUNT", 0.0) * named.get("MAX_LENGTH", 0.0)
    if wrong or length > named.get("END", 0.0) - named.get("BEGIN", 0.0):
        raise PluginError(
            f"The distribution '{text}' is invalid; give {form}, with the smaller number of each range first. The"
            " maximum number of windows with the maximum length must fit into the interval."
        )
    return numbers


@register("dataset", "random_drive")
@dataclass(frozen=True)
class RandomDrive:
    """A simulated drive whose parameters and faults are drawn with the seed, from distributions in a preset.

    Each seed gives a different drive, so a sweep over seeds is a sweep over drives. In each drive, each parameter has
    one random value from its distribution. A distribution is a line of text::

        speed_mps ~ uniform 0.9 to 2.2          roughness ~ log_normal 1.5 sigma 0.4    (median; sigma of the logarithm)
        size_m ~ log_uniform 0.5 to 10          trace ~ one_of comma2k19 pixel4 tokyo_1105
        times_s ~ times 2 in 15 to 145          windows_s ~ windows 1 to 3 of 2 to 10 in 15 to 145
        duration_s ~ always 60                  gyro_radps = accel_mps2 * 0.025         (of one that is drawn before)

    The number, the lengths and the positions of time windows are uniformly distributed, and windows do not overlap. The
    unit of a parameter is at the end of the parameter's name.

    A drive has 0, 1, 2 ... faults with the probabilities ``fault_shares``. The kinds of the faults are drawn without
    replacement, with equal probabilities. The faults are applied in the order of ``faults``. The preset `mixture` has
    the distributions that `jerkbench audit` uses.

    Each parameter has a separate random stream. A drive can be repeated: the drawn data set and the drawn disturbances,
    with the drawn parameters and the same seed, give an identical drive. Each row of a study contains the drawn values,
    in columns whose names start with ``drawn.``. A drawn number is stored unchanged. A drawn string is stored in a
    column with its name, for example ``drawn.trace.pixel4 = 1``. A drawn tuple has one column for each index. Each kind
    of fault of the drive is stored in a column with its name, for example ``drawn.fault.outliers = 1``. The column
    ``drawn.faults`` contains the number of faults.

    Attributes:
        bases: names of simulated data sets, one of which is drawn for each drive.
        drive: distributions of the parameters of the data set.
        fault_shares: probabilities of 0, 1, 2 ... faults [-].
        faults: one tuple for each kind of fault. The first element is the name of a disturbance or of a boolean
            parameter of the data set (for example ``ruts``). The other elements are the distributions of the parameters
            of the fault.
    """

    seeded: ClassVar[bool] = True

    bases: tuple[str, ...] = ("field",)
    drive: tuple[str, ...] = ()
    fault_shares: tuple[float, ...] = (1.0,)
    faults: tuple[tuple[str, ...], ...] = ()

    def __post_init__(self) -> None:
        for base in self.bases:
            if not getattr(plugins.get("dataset", base), "seeded", False) or base == "random_drive":
                raise PluginError(
                    f"random_drive: {base} is not a simulated data set; bases must name simulated data sets."
                )
        shares = np.array(self.fault_shares)
        if not self.bases or (shares < 0).any() or abs(shares.sum() - 1) > 1e-9 or len(shares) > len(self.faults) + 1:
            raise PluginError(
                f"random_drive: bases is {self.bases}, and fault_shares is {self.fault_shares} for {len(self.faults)}"
                " kinds of faults. Give at least one data set in bases. Give the probabilities of 0, 1, 2 ... faults in"
                f" fault_shares: at most {len(self.faults) + 1} numbers with the sum 1."
            )
        for kind, distributions in ("", self.drive), *((kind, distributions) for kind, *distributions in self.faults):
            drawn = [parse_distribution(text).parameter for text in distributions]
            owners = [("dataset", base) for base in self.bases] if self._of_drive(kind) else [("disturbance", kind)]
            for owner in owners:
                known = [f.name for f in dataclasses.fields(plugins.get(*owner))]
                for wrong in (name for name in drawn if name not in known):
                    raise PluginError(unknown(f"parameter of {' '.join(owner)}", wrong, known))

    def load(self, seed: int) -> Recording:
        """Return the recording of the random drive with ``seed``."""
        base, drive, faults = self.drawn(seed)
        switched = [{kind: True, **values} for kind, values in faults.items() if self._of_drive(kind)]
        parameters = {name: value for values in (drive, *switched) for name, value in values.items()}
        recording: Recording = plugins.create("dataset", {"name": base, **parameters}).load(seed)
        for kind, values in faults.items():
            if not self._of_drive(kind):
                recording = plugins.create("disturbance", {"name": kind, **values}).apply(recording, seed)
        return replace(recording, parameters=self.columns(seed), drawn=None if faults else recording.drawn)

    def fingerprint(self) -> str:
        """Return an empty string, because the data set does not read files."""
        return ""

    def drawn(self, seed: int) -> tuple[str, dict[str, Any], dict[str, dict[str, Any]]]:
        """Return the data set, its parameters, and the parameters of each kind of fault, drawn with ``seed``."""
        base = self.bases[stream(seed, "random_drive", "base").integers(len(self.bases))]
        random = stream(seed, "random_drive", "faults")
        count = random.choice(len(self.fault_shares), p=self.fault_shares)
        kinds = sorted(random.permutation(len(self.faults))[:count])
        chosen = (self.faults[index] for index in kinds)
        faults = {kind: _values(seed, kind, distributions) for kind, *distributions in chosen}
        return base, _values(seed, "", self.drive), faults

    def columns(self, seed: int) -> dict[str, float]:
        """Return the values drawn with ``seed`` as columns of the rows of a study."""
        base, drive, faults = self.drawn(seed)
        return dict(_numbers("drawn", {"base": base, **drive, "faults": len(faults), "fault": [*faults], **faults}))

    def _of_drive(self, kind: str) -> bool:
        """Return whether ``kind`` is empty (the drive itself) or the name of a boolean parameter of the data set."""
        bases = [plugins.get("dataset", base) for base in self.bases]
        return not kind or all(isinstance(getattr(base, kind, None), bool) for base in bases)


def _values(seed: int, kind: str, distributions: Sequence[str]) -> dict[str, Any]:
    """Draw the parameters of a kind of fault, or the parameters of the data set if ``kind`` is empty."""
    values: dict[str, Any] = {}
    for each in map(parse_distribution, distributions):
        values[each.parameter] = each.draw(stream(seed, "random_drive", kind, each.parameter), values)
    return values


def _numbers(name: str, value: Any) -> Iterator[tuple[str, float]]:  # noqa: ANN401 - any type of parameter
    if isinstance(value, (int, float)):
        yield name, float(value)
    elif isinstance(value, str):
        yield f"{name}.{value}", 1.0
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from _numbers(f"{name}.{key}", item)
    else:
        for index, item in enumerate(value):
            yield from _numbers(name if isinstance(item, str) else f"{name}.{index}", item)
