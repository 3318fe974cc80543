"""The tunable parameters of a method, their values (settings), and the samplers that select settings."""

import dataclasses
import warnings
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import is_attitude_only
from jerkbench.errors import PluginError, require_known
from jerkbench.jobs.job import Job
from jerkbench.parameters import Range, RScale, ranges_of, type_of

R_RANGE = Range(0.05, 20.0, log=True, source="ours: from a fifth to four times the reported sigma")
"""The range of each factor on the reported R."""
EDGE = 0.02
"""Distance from an end of the range of a parameter, as a fraction of the range, within which a value is at the edge."""
R_STREAMS = tuple(field.name for field in dataclasses.fields(RScale))
"""Streams whose R has a factor: position and velocity."""

Setting = tuple[float, ...]
"""A value for each tunable parameter, in the order of the parameters."""


@dataclass(frozen=True)
class TunableParameter:
    """A parameter that a search may change.

    Attributes:
        part: The part of the method that has the parameter: "filter", "adaptation", "r_scale" or "attitude".
        field: Name of the parameter in this part of the method.
        bounds: Range of the values that a search may evaluate.
        start: Value of the parameter before the search.
        kind: Type of the values. A parameter of the type bool is a switch with the values 1 and 0.
    """

    part: str
    field: str
    bounds: Range
    start: float
    kind: type = float

    @property
    def name(self) -> str:
        """The key of the parameter on the command line, for example "filter.accel_mps2"."""
        return f"{self.part}.{self.field}"

    def value(self, fraction: float) -> float:
        """Return the value of the parameter at a fraction (0 to 1) of its range."""
        value = self.bounds.value(fraction)
        return float(round(value)) if self.kind in (bool, int) else value

    def fraction(self, value: float) -> float:
        """Return the position of a value in the range as a fraction (0 to 1)."""
        return self.bounds.share(min(max(value, self.bounds.low), self.bounds.high))

    def typed(self, value: float) -> float:
        """Return a value converted to the type of the field: bool, int or float."""
        return self.kind(round(value)) if self.kind in (bool, int) else value


@dataclass(frozen=True)
class Space:
    """The tunable parameters of a method.

    Attributes:
        parameters: Parameters of the filter, the adaptation and the scale of R, or parameters of the attitude filter.
    """

    parameters: tuple[TunableParameter, ...]

    @property
    def start(self) -> Setting:
        """The values of all parameters before the search."""
        return tuple(parameter.start for parameter in self.parameters)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the tunable parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    def setting(self, fractions: FloatArray) -> Setting:
        """Return the setting at the given fractions of the ranges, shape (d,)."""
        return tuple(p.value(float(fraction)) for p, fraction in zip(self.parameters, fractions, strict=True))

    def fractions(self, settings: Sequence[Setting]) -> FloatArray:
        """Return the positions of parameter values in their ranges as fractions, shape (number of settings, d)."""
        return np.array(
            [[p.fraction(v) for p, v in zip(self.parameters, setting, strict=True)] for setting in settings]
        )

    def of_part(self, part: str, setting: Setting) -> dict[str, Any]:
        """Return the values of a setting for one part of the method, as a mapping from parameter name to value."""
        pairs = zip(self.parameters, setting, strict=True)
        return {parameter.field: parameter.typed(value) for parameter, value in pairs if parameter.part == part}

    def applied(self, job: Job, setting: Setting) -> Job:
        """Return a copy of the job with the values of ``setting``.

        Raises:
            PluginError: The plugin rejects this combination of values, although each value is in its range.
        """
        return job.at({part: self.of_part(part, setting) for part in ("filter", "adaptation", "r_scale", "attitude")})

    def at_edge(self, setting: Setting) -> list[str]:
        """Return a message for each parameter whose value is at an end of its range. Switches are skipped."""
        messages = []
        for parameter, value in zip(self.parameters, setting, strict=True):
            fraction = 0.5 if parameter.kind is bool else parameter.fraction(value)
            if min(fraction, 1.0 - fraction) <= EDGE:
                end = "low" if fraction <= EDGE else "high"
                where = f"{parameter.name} = {value:g} lies at the {end} end of its range ({parameter.bounds})"
                messages.append(f"{where}; the best may lie beyond.")
        return messages


def space_of(job: Job, selected: Collection[str] = (), measured: Collection[str] = R_STREAMS) -> Space:
    """Return the search space of the method of a job: the parameters with a range, and the factors on R.

    For `attitude_only`, the space consists of the parameters of the attitude filter.

    Args:
        job: The job with the values before the search.
        selected: Names of the parameters to tune. If ``selected`` is empty, all parameters are tuned.
        measured: Streams (position, velocity) that the recordings contain. Factors on R of other streams are not tuned.

    Raises:
        PluginError: The method has no tunable parameter, or a selected name is unknown.
    """
    parts = ("attitude",) if is_attitude_only(job.method.filter) else ("filter", "adaptation")
    parameters = [parameter for part in parts for parameter in _parameters(part, job.part(part))]
    if not parameters:
        names = " and ".join(f"the {part} {job.spec[part]['name']}" for part in parts)
        raise PluginError(f"There is nothing to tune: no parameter of {names} has a range (see `jerkbench show`).")
    if parts != ("attitude",):
        scale, streams = job.method.r_scale, [name for name in R_STREAMS if name in measured]
        parameters += [TunableParameter("r_scale", n, R_RANGE, getattr(scale, n)) for n in streams]
    for name in selected:
        require_known("parameter", name, [parameter.name for parameter in parameters])
    return Space(tuple(parameter for parameter in parameters if not selected or parameter.name in selected))


def _parameters(part: str, plugin: object) -> Sequence[TunableParameter]:
    return [
        TunableParameter(part, name, bounds, float(getattr(plugin, name)), type_of(type(plugin), name))
        for name, bounds in ranges_of(type(plugin)).items()
    ]


class Sobol:
    """A sampler of a scrambled Sobol sequence, which covers the search space evenly and does not depend on the losses.

    The coverage is the same for all methods, so this sampler is suitable for comparisons.

    Source: A. B. Owen, "Scrambling Sobol' and Niederreiter-Xing points", Journal of Complexity 14, 1998,
    doi:10.1006/jcom.1998.0487; `scipy.stats.qmc.Sobol`.
    """

    def __init__(self, dimensions: int, seed: int) -> None:
        from scipy.stats import qmc

        self._sequence = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed), bits=30)

    def suggest(self, count: int) -> FloatArray:
        """Return the next ``count`` points of the Sobol sequence as fractions of the ranges, shape (count, d)."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # SciPy warns if the number of points is not a power of two
            return np.asarray(self._sequence.random(count), dtype=np.float64)

    def observe(self, losses: Sequence[float]) -> None:
        """Ignore the losses, because a Sobol sequence does not depend on losses."""


class Optuna:
    """A sampler of the library Optuna (extra ``tune``), which uses the losses of all earlier settings."""

    def __init__(self, dimensions: int, seed: int, sampler: str, **options: Any) -> None:  # noqa: ANN401 - Optuna's
        try:
            import cmaes  # noqa: F401 - imported late by Optuna's CMA-ES
            import optuna
        except ImportError as error:
            needed = f"{error.name}: `pip install 'jerkbench[tune]'`, or use sampler=sobol"
            raise PluginError(f"The samplers tpe and cma_es need {needed}.") from error
        optuna.logging.set_verbosity(optuna.logging.ERROR)
        self._study = optuna.create_study(sampler=getattr(optuna.samplers, sampler)(seed=seed, **options))
        unit = optuna.distributions.FloatDistribution(0.0, 1.0)
        self._shares: dict[str, Any] = {f"{k}": unit for k in range(dimensions)}
        self._trials: list[Any] = []

    def suggest(self, count: int) -> FloatArray:
        """Return the next ``count`` settings that Optuna suggests as fractions of the ranges, shape (count, d)."""
        self._trials = [self._study.ask(self._shares) for _ in range(count)]
        return np.array([[trial.params[name] for name in self._shares] for trial in self._trials])

    def observe(self, losses: Sequence[float]) -> None:
        """Report the losses of the last suggested settings to Optuna."""
        for trial, loss in zip(self._trials, losses, strict=True):
            self._study.tell(trial, loss)


Sampler = Sobol | Optuna
"""An algorithm that selects settings. Samplers are deterministic: the same calls return the same settings."""

SAMPLERS: dict[str, Callable[[int, int], Sampler]] = {
    "sobol": Sobol,
    "tpe": partial(Optuna, sampler="TPESampler"),
    "cma_es": partial(Optuna, sampler="CmaEsSampler", warn_independent_sampling=False),
}


def sampler_of(name: str, dimensions: int, seed: int) -> Sampler:
    """Create the sampler with the name ``name``.

    Raises:
        PluginError: The name is unknown, or the library of the sampler is not installed.
    """
    require_known("sampler", name, SAMPLERS)
    return SAMPLERS[name](dimensions, seed)
