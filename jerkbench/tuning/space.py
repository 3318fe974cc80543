"""The parameters of a method that a search may change, the settings of them, and the samplers that choose these."""

import dataclasses
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
from jerkbench.timeline import RScale

R_RANGE = Range(0.05, 20.0, log=True, source="ours: from a fifth to four times the reported sigma")
"""The range of each factor on the reported R."""

EDGE = 0.02
"""A share of the way that is as good as a bound."""

R_STREAMS = tuple(f.name for f in dataclasses.fields(RScale))
"""Streams of which a filter is told R: position, velocity."""

Setting = tuple[float, ...]
"""A value for each knob, in their order."""


@dataclass(frozen=True)
class Knob:
    """A parameter that a search may change.

    Attributes:
        part: "filter", "adaptation", "r_scale" or "attitude".
        field: its name there.
        bounds: the values to try.
        whole: whether it holds whole numbers.
        start: its value before the search.
        switch: whether it is on or off, which are 1 and 0.
    """

    part: str
    field: str
    bounds: Range
    whole: bool
    start: float
    switch: bool = False

    @property
    def name(self) -> str:
        """Its key on the command line, for example "filter.accel_mps2"."""
        return f"{self.part}.{self.field}"

    def value(self, share: float) -> float:
        """Return the value at ``share`` of the way from low to high."""
        value = self.bounds.value(share)
        return float(round(value)) if self.whole or self.switch else value

    def share(self, value: float) -> float:
        """Return how much of the way from low to high ``value`` is, 0 to 1."""
        return self.bounds.share(min(max(value, self.bounds.low), self.bounds.high))

    def typed(self, value: float) -> float:
        """Return ``value`` as the field holds it."""
        return bool(value) if self.switch else round(value) if self.whole else value


@dataclass(frozen=True)
class Space:
    """The knobs of a method.

    Attributes:
        knobs: in order: those of the filter, of the adaptation, of the reported R; or those of the attitude filter.
    """

    knobs: tuple[Knob, ...]

    @property
    def start(self) -> Setting:
        """The setting before the search."""
        return tuple(knob.start for knob in self.knobs)

    @property
    def names(self) -> tuple[str, ...]:
        """The knobs' names."""
        return tuple(knob.name for knob in self.knobs)

    def setting(self, shares: FloatArray) -> Setting:
        """Return the values at ``shares`` (d,) of the ways from low to high."""
        return tuple(knob.value(float(share)) for knob, share in zip(self.knobs, shares, strict=True))

    def of_part(self, part: str, setting: Setting) -> dict[str, Any]:
        """Return the values of the fields of one part."""
        pairs = zip(self.knobs, setting, strict=True)
        return {knob.field: knob.typed(value) for knob, value in pairs if knob.part == part}

    def applied(self, job: Job, setting: Setting) -> Job:
        """Return the job with the values of ``setting``.

        Raises:
            PluginError: the plugin does not take values that are each in their range.
        """
        return job.at({part: self.of_part(part, setting) for part in ("filter", "adaptation", "r_scale", "attitude")})

    def at_edge(self, setting: Setting) -> list[str]:
        """Return a sentence for each knob, no switch, whose value lies on a bound of its range."""
        sentences = []
        for knob, value in zip(self.knobs, setting, strict=True):
            share = 0.5 if knob.switch else knob.share(value)
            if share <= EDGE or share >= 1.0 - EDGE:
                end = "low" if share <= EDGE else "high"
                where = f"{knob.name} = {value:g} lies at the {end} end of its range ({knob.bounds})"
                sentences.append(f"{where}; the best may lie beyond.")
        return sentences


def space_of(job: Job, chosen: Collection[str] = (), measured: Collection[str] = R_STREAMS) -> Space:
    """Return the knobs of the method of a job: fields with a range, and what is told of R.

    Where nothing is navigated they are those of the attitude filter.

    Args:
        job: with the values to begin from.
        chosen: names of the knobs to change; empty: all there are.
        measured: the streams that the recordings have; R of others tells nothing.

    Raises:
        PluginError: there is none, or none of a chosen name.
    """
    parts = ("attitude",) if is_attitude_only(job.method.filter) else ("filter", "adaptation")
    own = [knob for part in parts for knob in _knobs(part, job.part(part))]
    if not own:
        names = " nor ".join(f"the {part} {job.spec[part]['name']}" for part in parts)
        lacking = f"neither {names} has a" if len(parts) > 1 else f"{names} has no"
        raise PluginError(f"There is nothing to tune: {lacking} parameter with a range (`jerkbench show`).")
    scale = job.method.r_scale
    told = [Knob("r_scale", name, R_RANGE, False, getattr(scale, name)) for name in R_STREAMS if name in measured]  # noqa: FBT003
    knobs = own if parts == ("attitude",) else [*own, *told]
    known = [knob.name for knob in knobs]
    for name in chosen:
        require_known("knob", name, known)
    return Space(tuple(knob for knob in knobs if not chosen or knob.name in chosen))


def _knobs(part: str, plugin: object) -> Sequence[Knob]:
    cls = type(plugin)
    return [
        Knob(part, name, bounds, is_whole(cls, name), float(getattr(plugin, name)), is_switch(cls, name))
        for name, bounds in ranges_of(cls).items()
    ]


# The samplers: which settings a search tries next, given what the ones before were worth.


class Sampler(Protocol):
    """A way to choose settings; the same calls give the same settings."""

    def ask(self, count: int) -> FloatArray:
        """Return (count, d) the next settings, as shares of the ways from low to high."""
        ...

    def tell(self, losses: Sequence[float]) -> None:
        """Take what the settings that were asked for last were worth; the smaller, the better."""
        ...


FIRST_POINTS_LOG2 = 6
"""Points of a sequence that are made at once, as a power of two."""


class Sobol:
    """A scrambled Sobol sequence, which fills the space evenly and looks at no result.

    Every method gets the same coverage, whatever its losses are like: the sampler for comparisons.

    Source: A. B. Owen, "Scrambling Sobol' and Niederreiter-Xing points", Journal of Complexity 14, 1998,
    doi:10.1006/jcom.1998.0487; `scipy.stats.qmc.Sobol`.
    """

    def __init__(self, dimensions: int, seed: int) -> None:
        """Begin the sequence of ``seed``, which scrambles it."""
        from scipy.stats import qmc

        self._sequence = qmc.Sobol(dimensions, scramble=True, rng=np.random.default_rng(seed), bits=30)
        self._points, self._asked = self._sequence.random_base2(FIRST_POINTS_LOG2), 0

    def ask(self, count: int) -> FloatArray:
        """Return the next points."""
        begin, self._asked = self._asked, self._asked + count
        while len(self._points) < self._asked:  # the sequence is even where it ends at a power of two
            more = self._sequence.random_base2(int(np.log2(len(self._points))))
            self._points = np.concatenate([self._points, more])
        return np.asarray(self._points[begin : self._asked], dtype=np.float64)

    def tell(self, losses: Sequence[float]) -> None:
        """Do nothing: the sequence does not depend on results."""


class Optuna:
    """A sampler of Optuna (the extra `tune`): it learns from the results, and so suits some methods better than others.

    Settings are asked for in blocks; within a block it does not learn.
    """

    def __init__(self, dimensions: int, seed: int, sampler: str, **options: Any) -> None:  # noqa: ANN401 - Optuna's
        """Begin with the class ``sampler`` of Optuna and its ``options``."""
        try:
            import cmaes  # noqa: F401 - Optuna's CMA-ES asks for it late
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
        """Hand the losses over."""
        for trial, loss in zip(self._asked, losses, strict=True):
            self._study.tell(trial, loss)


SAMPLERS: dict[str, Callable[[int, int], Sampler]] = {
    "sobol": Sobol,
    "tpe": partial(Optuna, sampler="TPESampler"),
    "cma_es": partial(Optuna, sampler="CmaEsSampler", warn_independent_sampling=False),
}


def sampler_of(name: str, dimensions: int, seed: int) -> Sampler:
    """Return the sampler ``name`` at its begin.

    Raises:
        PluginError: there is none of that name, or its library is not installed.
    """
    require_known("sampler", name, SAMPLERS)
    return SAMPLERS[name](dimensions, seed)
