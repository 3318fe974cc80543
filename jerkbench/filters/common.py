"""Functions and classes that several linear filters share: models of one axis, updates, parameter ranges."""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, Self

import numpy as np

from jerkbench import plugins
from jerkbench.arrays import FloatArray
from jerkbench.contracts import Adaptation, AdaptingGain, AdaptingPrior, Fading, clocked
from jerkbench.estimate import Attitude, Estimate, Streamed
from jerkbench.kalman import updated
from jerkbench.numpy_run import AdaptedUpdates
from jerkbench.parameters import DefaultOrigin, Limited, Range
from jerkbench.recording import Recording
from jerkbench.timeline import RecordedRun, Run, Timeline, cached_timeline

# Models of one axis for an array of step lengths, because the steps of an IMU with irregular time stamps differ.

Models = tuple[FloatArray, FloatArray, FloatArray]
"""A (k, n, n), b (k, n) and Q (k, n, n) of one axis with n states, for k step lengths."""


class AxisModels(Limited):
    """Base class of filters that compute the models of one axis for an array of step lengths in one call."""

    def axis_models(self, dt: FloatArray, dt0: float) -> Models:
        """Return A (k, n, n), b (k, n) and Q (k, n, n) of one axis for k steps of ``dt`` (k,) seconds."""
        raise NotImplementedError

    def initial_variances(self) -> FloatArray:
        """Return an empty array (0,), because a filter without a third state has no further variances."""
        return np.zeros(0)

    def axis_model(self, dt: float, dt0: float) -> Models:
        """Return A (n, n), b (n,) and Q (n, n) of one axis for a step of ``dt`` seconds."""
        A, b, Q = self.axis_models(np.array([dt]), dt0)
        return A[0], b[0], Q[0]


def identities(dt: FloatArray, n: int) -> FloatArray:
    """Return an array (k, n, n) with one n x n identity matrix for each element of ``dt`` (k,)."""
    return np.tile(np.eye(n), (len(dt), 1, 1))


def outer(scale: FloatArray, b: FloatArray) -> FloatArray:
    """Return the scaled outer products scale b b' (k, n, n) for each ``scale`` (k,) and ``b`` (k, n)."""
    return np.asarray(scale[:, None, None] * (b[:, :, None] * b[:, None, :]))


class MeasurementUpdates(AdaptedUpdates):
    """The measurement updates of one run of a linear filter whose state starts with position and velocity."""

    def __call__(self, update: int, x: FloatArray, P: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return x and P after an update, and the prior covariance that the update used.

        An adaptation may multiply the prior covariance by a fading factor. If the adaptation drops all rows of the
        measurement, the state x does not change.
        """
        y, R, rows = self.take(update, lambda z, rows: (z - x[rows], P[np.ix_(rows, rows)]))
        prior = P * self.fading
        if rows.size:
            x, P = updated(x, prior, y, np.eye(len(x))[rows], R)
        return x, P if rows.size else prior, prior


CompiledFunctions = tuple[Callable[..., Estimate | None], Callable[..., Sequence[Streamed | None]]]
"""The function that runs one timeline and returns its trajectory, and the function that runs a batch of timelines."""


class CompiledEstimator:
    """Base class of estimators that are based on kinematic filters and run in compiled code.

    This class implements the protocol `jerkbench.contracts.Batched`.
    """

    def compiled_functions(self) -> CompiledFunctions | None:
        """Return the compiled function for one timeline and the compiled function for a batch of timelines.

        Return None if the estimator has no compiled functions.
        """
        raise NotImplementedError

    def start(self, timeline: Timeline) -> Any:  # noqa: ANN401 - the compiled functions determine the type
        """Return the argument of the compiled functions that describes the filters and their initial state."""
        raise NotImplementedError

    def estimate_compiled(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate | None:
        """Return the same result as ``estimate``, computed by compiled code.

        Return None if this estimator has no compiled functions, if numba cannot compile the adaptation, or if the
        adaptation raises an error.
        """
        from jerkbench.kinematic.rules import compiled_rule  # importing this module takes half a second

        timeline, functions = cached_timeline(recording, attitude), self.compiled_functions()
        rule = compiled_rule(clocked(adaptation, timeline))
        return None if rule is None or functions is None else functions[0](timeline, self.start(timeline), rule)

    def run_settings(
        self,
        runs: Sequence[RecordedRun],
        estimators: Sequence[Self],
        adaptations: Sequence[Adaptation],
        *,
        updates: bool,
        attitude: bool,
        threads: int,
    ) -> Sequence[Streamed | None]:
        """Run each run k with ``estimators[k]`` and ``adaptations[k]``, and return the error sums of each run.

        The result is None for a run that compiled code cannot compute. The argument ``attitude`` has no effect, because
        these estimators do not estimate the attitude.
        """
        from jerkbench.kinematic.rules import compiled_rule

        functions = [estimator.compiled_functions() for estimator in estimators]
        if not runs or functions[0] is None or None in functions:
            return [None] * len(runs)
        compiled_runs = [Run(run.timeline, run.scoring) for run in runs]
        rules = [compiled_rule(clocked(a, run.timeline)) for a, run in zip(adaptations, runs, strict=True)]
        starts = [one.start(run.timeline) for one, run in zip(estimators, runs, strict=True)]
        return functions[0][1](compiled_runs, starts, rules, updates=updates, threads=threads)


# The names of the adaptations that an estimator supports.


def adaptations_of_r() -> tuple[str, ...]:
    """Return the names of all adaptations that change only R, including third-party plugins."""
    return _adaptations_without((Fading, AdaptingPrior, AdaptingGain))


class AdaptedR:
    """Base class of estimators that support all adaptations that change only R."""

    @property
    def adaptations(self) -> tuple[str, ...]:
        """Names of the supported adaptations: all adaptations that change only R."""
        return adaptations_of_r()


def adaptations_of_r_or_fading() -> tuple[str, ...]:
    """Return the names of all adaptations that change only R or multiply the prior covariance by a fading factor."""
    return _adaptations_without((AdaptingPrior, AdaptingGain))


def _adaptations_without(contracts: tuple[type, ...]) -> tuple[str, ...]:
    names = plugins.names("adaptation")
    return tuple(name for name in names if not _implements(plugins.get("adaptation", name), contracts))


@cache  # isinstance is slow for a protocol, and a sweep checks each pair of filter and adaptation
def _implements(adaptation: type, contracts: tuple[type, ...]) -> bool:
    return isinstance(adaptation, contracts)


# Tuning ranges and origins of default values, for the noise parameters that several filters share.

ACCEL_RANGE = Range(
    0.01,
    10.0,
    log=True,
    source="ours: from half the noise of the simulated accelerometer to the best value of the baseline on a real car",
)
JERK_WALK = Range(0.1, 100.0, log=True, source="ours: the range of the bias walk, times 2/dt at 100 Hz, narrowed")
BIAS_WALK = Range(1e-4, 1.0, log=True, source="ours: from the instability of a good MEMS sensor to leaking gravity")
ACCEL_WALK = Range(0.05, 50.0, log=True, source="ours: from a ship to a race car")
VELOCITY_WALK = Range(0.01, 30.0, log=True, source="ours: from a slow robot to a braking car")
STAYS = Range(0.5, 0.999, toward_one=True, source="ours: from a model that lasts 2 updates to one that lasts 1000")

FIELD = DefaultOrigin("tuned by hand on the simulated field; the paper gives no value")
START = DefaultOrigin("ours: large enough to have no effect after the first seconds of the simulated field")
WALK = DefaultOrigin("ours: a vehicle that changes its acceleration by 2 m/s2 within a second")
FROM_FILTER = DefaultOrigin("the default of the filter without mixing or smoothing")
