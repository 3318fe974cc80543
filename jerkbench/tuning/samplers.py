"""The samplers: which settings a search tries next, given what the ones before were worth."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Protocol

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import PluginError, unknown


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
        self._shares: dict[str, Any] = {
            f"{k}": optuna.distributions.FloatDistribution(0.0, 1.0) for k in range(dimensions)
        }
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
    if name not in SAMPLERS:
        raise PluginError(unknown("sampler", name, SAMPLERS))
    return SAMPLERS[name](dimensions, seed)
