"""The parameters of a method that a search may change, their settings, and the samplers that choose settings."""

import dataclasses
import warnings
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import is_attitude_only
from jerkbench.errors import PluginError, require_known
from jerkbench.jobs.job import Job
from jerkbench.parameters import Range, is_switch, is_whole, ranges_of
from jerkbench.r_scale import RScale

R_RANGE = Range(0.05, 20.0, log=True, source="ours: from a fifth to four times the reported sigma")
"""The range of each factor on the reported R."""
EDGE = 0.02
"""Fraction of a range that counts as its end."""
R_STREAMS = tuple(field.name for field in dataclasses.fields(RScale))
"""Streams with a factor on R: position, velocity."""

Setting = tuple[float, ...]
"""A value for each tunable parameter, in their order."""


@dataclass(frozen=True)
class TunableParameter:
    """A parameter that a search may change.

    Attributes:
        part: "filter", "adaptation", "r_scale" or "attitude".
        field: name of the parameter in its part.
        bounds: range of its values.
        whole: whether the values are integers.
        start: value before the search.
        switch: whether the parameter is a switch with the values 1 and 0.
    """

    part: str
    field: str
    bounds: Range
    whole: bool
    start: float
    switch: bool = False

    @property
    def name(self) -> str:
        """Key on the command line, for example "filter.accel_mps2"."""
        return f"{self.part}.{self.field}"

    def value(self, fraction: float) -> float:
        """Return the value at ``fraction`` of the range."""
        value = self.bounds.value(fraction)
        return float(round(value)) if self.whole or self.switch else value

    def fraction(self, value: float) -> float:
        """Return the position of ``value`` in the range, from 0 to 1."""
        return self.bounds.share(min(max(value, self.bounds.low), self.bounds.high))

    def typed(self, value: float) -> float:
        """Return ``value`` with the type of the field."""
        return bool(value) if self.switch else round(value) if self.whole else value


@dataclass(frozen=True)
class Space:
    """The tunable parameters of a method.

    Attributes:
        parameters: those of the filter, of the adaptation and of the reported R, or those of the attitude filter.
    """

    parameters: tuple[TunableParameter, ...]

    @property
    def start(self) -> Setting:
        """The setting before the search."""
        return tuple(parameter.start for parameter in self.parameters)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    def setting(self, fractions: FloatArray) -> Setting:
        """Return the values at the ``fractions`` (d,) of the ranges."""
        return tuple(p.value(float(fraction)) for p, fraction in zip(self.parameters, fractions, strict=True))

    def fractions(self, settings: Sequence[Setting]) -> FloatArray:
        """Return the positions (n, d) of the values in their ranges."""
        return np.array([[p.fraction(v) for p, v in zip(self.parameters, own, strict=True)] for own in settings])

    def of_part(self, part: str, setting: Setting) -> dict[str, Any]:
        """Return the values of the fields of one part."""
        pairs = zip(self.parameters, setting, strict=True)
        return {parameter.field: parameter.typed(value) for parameter, value in pairs if parameter.part == part}

    def applied(self, job: Job, setting: Setting) -> Job:
        """Return the job with the values of ``setting``.

        Raises:
            PluginError: The plugin does not take values that are each in their range.
        """
        return job.at({part: self.of_part(part, setting) for part in ("filter", "adaptation", "r_scale", "attitude")})

    def at_edge(self, setting: Setting) -> list[str]:
        """Return a message for each parameter, except switches, whose value lies at an end of its range."""
        messages = []
        for parameter, value in zip(self.parameters, setting, strict=True):
            fraction = 0.5 if parameter.switch else parameter.fraction(value)
            if min(fraction, 1.0 - fraction) <= EDGE:
                end = "low" if fraction <= EDGE else "high"
                messages.append(
                    f"{parameter.name} = {value:g} lies at the {end} end of its range ({parameter.bounds}); the best"
                    " may lie beyond."
                )
        return messages


def space_of(job: Job, chosen: Collection[str] = (), measured: Collection[str] = R_STREAMS) -> Space:
    """Return the search space of the method of a job: parameters with a range, and the factors on R.

    The space of `attitude_only` consists of the parameters of the attitude filter.

    Args:
        job: The job with the values before the search.
        chosen: Names of the parameters to change; empty: all.
        measured: Streams of the recordings. R of other streams is not tuned.

    Raises:
        PluginError: There is no tunable parameter, or none of a chosen name.
    """
    parts = ("attitude",) if is_attitude_only(job.method.filter) else ("filter", "adaptation")
    parameters = [parameter for part in parts for parameter in _parameters(part, job.part(part))]
    if not parameters:
        names = " nor ".join(f"the {part} {job.spec[part]['name']}" for part in parts)
        lacking = f"neither {names} has a" if len(parts) > 1 else f"{names} has no"
        raise PluginError(f"There is nothing to tune: {lacking} parameter with a range (`jerkbench show`).")
    if parts != ("attitude",):
        scale, streams = job.method.r_scale, [name for name in R_STREAMS if name in measured]
        parameters += [TunableParameter("r_scale", n, R_RANGE, whole=False, start=getattr(scale, n)) for n in streams]
    for name in chosen:
        require_known("parameter", name, [parameter.name for parameter in parameters])
    return Space(tuple(parameter for parameter in parameters if not chosen or parameter.name in chosen))


def _parameters(part: str, plugin: object) -> Sequence[TunableParameter]:
    cls = type(plugin)
    return [
        TunableParameter(part, name, bounds, is_whole(cls, name), float(getattr(plugin, name)), is_switch(cls, name))
        for name, bounds in ranges_of(cls).items()
    ]


class Sampler(Protocol):
    """A method to choose settings. The same calls return the same settings."""

    def ask(self, count: int) -> FloatArray:
        """Return the next settings (count, d), as fractions of the ranges."""
        ...

    def tell(self, losses: Sequence[float]) -> None:
        """Receive the losses of the last settings; smaller is better."""
        ...


class Sobol:
    """A scrambled Sobol sequence, which covers the space evenly and does not depend on results.

    Every method gets the same coverage, so this sampler suits comparisons.

    Source: A. B. Owen, "Scrambling Sobol' and Niederreiter-Xing points", Journal of Complexity 14, 1998,
    doi:10.1006/jcom.1998.0487; `scipy.stats.qmc.Sobol`.
    """

    def __init__(self, dimensions: int, seed: int) -> None:
        """Start the sequence of ``seed``, which scrambles it."""
        from scipy.stats import qmc

        self._sequence = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed), bits=30)

    def ask(self, count: int) -> FloatArray:
        """Return the next points."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # the number of points is not a power of two
            return np.asarray(self._sequence.random(count), dtype=np.float64)

    def tell(self, losses: Sequence[float]) -> None:
        """Ignore the losses."""


class Optuna:
    """A sampler of Optuna (the extra `tune`). It learns from the results after each block of settings."""

    def __init__(self, dimensions: int, seed: int, sampler: str, **options: Any) -> None:  # noqa: ANN401 - Optuna's
        """Start the class ``sampler`` of Optuna with its ``options``."""
        try:
            import cmaes  # noqa: F401 - imported late by Optuna's CMA-ES
            import optuna
        except ImportError as error:
            raise PluginError(
                f"The samplers tpe and cma_es need {error.name}: pip install 'jerkbench[tune]', or take sampler=sobol."
            ) from error
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        self._study = optuna.create_study(sampler=getattr(optuna.samplers, sampler)(seed=seed, **options))
        unit = optuna.distributions.FloatDistribution(0.0, 1.0)
        self._shares: dict[str, Any] = {f"{k}": unit for k in range(dimensions)}
        self._asked: list[Any] = []

    def ask(self, count: int) -> FloatArray:
        """Return the next settings."""
        self._asked = [self._study.ask(self._shares) for _ in range(count)]
        return np.array([[trial.params[name] for name in self._shares] for trial in self._asked])

    def tell(self, losses: Sequence[float]) -> None:
        """Pass the losses on."""
        for trial, loss in zip(self._asked, losses, strict=True):
            self._study.tell(trial, loss)


SAMPLERS: dict[str, Callable[[int, int], Sampler]] = {
    "sobol": Sobol,
    "tpe": partial(Optuna, sampler="TPESampler"),
    "cma_es": partial(Optuna, sampler="CmaEsSampler", warn_independent_sampling=False),
}


def sampler_of(name: str, dimensions: int, seed: int) -> Sampler:
    """Return the sampler ``name`` at its start.

    Raises:
        PluginError: There is no sampler of that name, or its library is not installed.
    """
    require_known("sampler", name, SAMPLERS)
    return SAMPLERS[name](dimensions, seed)
