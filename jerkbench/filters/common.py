"""What linear estimators share: the model of three axes, the start, the measurement updates, ranges of noises."""

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, NamedTuple, Self

import numpy as np

from jerkbench import plugins
from jerkbench.adapted_updates import AdaptedUpdates
from jerkbench.arrays import FloatArray
from jerkbench.contracts import Adaptation, AdaptingGain, AdaptingPrior, Fading, Filter, clocked
from jerkbench.estimate import Attitude, Estimate, Streamed
from jerkbench.kalman import updated
from jerkbench.parameters import DefaultOrigin, Limited, Range
from jerkbench.recording import Recording
from jerkbench.timeline import RecordedRun, Run, Timeline, kept_timeline


class StepModel(NamedTuple):
    """The model of one step for all three axes.

    Attributes:
        F: (n, n) A (x) I3.
        B: (n, 3) b (x) I3.
        Q: (n, n) Q (x) I3.
    """

    F: FloatArray
    B: FloatArray
    Q: FloatArray


class StepModels:
    """Step models of a filter, made once for each whole nanosecond."""

    def __init__(self, model: Filter, dt0_s: float) -> None:
        """Start without any."""
        self._model, self._dt0_s = model, dt0_s
        self._known: dict[int, StepModel] = {}

    def of(self, dt_s: float) -> StepModel:
        """Return the model of a step of ``dt_s``."""
        key = round(dt_s * 1e9)
        if key not in self._known:
            A, b, Q = self._model.axis_model(dt_s, self._dt0_s)
            self._known[key] = StepModel(_of_three_axes(A), _of_three_axes(b[:, None]), _of_three_axes(Q))
        return self._known[key]


def initial(timeline: Timeline, model: Filter) -> tuple[FloatArray, FloatArray]:
    """Return x (n,) and P (n, n) at the start of ``timeline``."""
    extra = np.repeat(model.initial_variances(), 3)
    P = np.diag(np.concatenate([np.zeros(6), extra]))
    P[:6, :6] = timeline.P0
    return np.concatenate([timeline.x0, np.zeros(len(extra))]), P


def _of_three_axes(matrix: FloatArray) -> FloatArray:
    return np.asarray(np.kron(matrix, np.eye(3)), dtype=np.float64)


# Models of one axis for many lengths of a step at once: an IMU with uneven stamps has as many as
# samples.

Models = tuple[FloatArray, FloatArray, FloatArray]
"""A (k, n, n), b (k, n), Q (k, n, n)."""


class AxisModels(Limited):
    """A filter that writes its model down for all lengths; that of one length is one of them."""

    def axis_models(self, dt: FloatArray, dt0: float) -> Models:
        """Return A (k, n, n), b (k, n), Q (k, n, n) for steps of ``dt`` (k,) seconds."""
        raise NotImplementedError

    def axis_model(self, dt: float, dt0: float) -> Models:
        """Return A (n, n), b (n,), Q (n, n) for a step of ``dt`` seconds."""
        A, b, Q = self.axis_models(np.array([dt]), dt0)
        return A[0], b[0], Q[0]


def identities(dt: FloatArray, n: int) -> FloatArray:
    """Return the identity (k, n, n) for each of ``dt`` (k,)."""
    return np.tile(np.eye(n), (len(dt), 1, 1))


def outer(scale: FloatArray, b: FloatArray) -> FloatArray:
    """Return scale b b' (k, n, n) of each ``scale`` (k,) and ``b`` (k, n)."""
    return np.asarray(scale[:, None, None] * (b[:, :, None] * b[:, None, :]))


# The measurement updates of an estimator whose state begins with position and velocity.


class MeasurementUpdates(AdaptedUpdates):
    """The measurement updates of one run, of a state and its covariance."""

    def __call__(self, update: int, x: FloatArray, P: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return x and P after an update, and the prior covariance that it took, which may be faded.

        Where every row of it is dropped the state stays as it is.
        """
        y, R, rows = self.take(update, lambda z, rows: (z - x[rows], P[np.ix_(rows, rows)]))
        prior = P * self.fading
        if rows.size:
            x, P = updated(x, prior, y, np.eye(len(x))[rows], R)
        return x, P if rows.size else prior, prior


CompiledWays = tuple[Callable[..., Estimate | None], Callable[..., Sequence[Streamed | None]]]
"""What runs one timeline with its trajectory, and what runs several without."""


class OverTimelines:
    """The compiled way of an estimator over kinematic filters: `jerkbench.contracts.Batched`."""

    def compiled_ways(self) -> CompiledWays | None:
        """Return what runs one timeline with its trajectory, and what runs several without; None: nothing does."""
        raise NotImplementedError

    def start(self, timeline: Timeline) -> Any:  # noqa: ANN401 - what its compiled ways begin with
        """Return the filters at the start of a timeline."""
        raise NotImplementedError

    def estimate_compiled(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate | None:
        """Return what ``estimate`` does; None where numba cannot compile the adaptation, or the run stops."""
        from jerkbench.kinematic.plugin_call import compiled_rule  # what it imports takes half a second

        timeline, ways = kept_timeline(recording, attitude), self.compiled_ways()
        rule = compiled_rule(clocked(adaptation, timeline))
        return None if rule is None or ways is None else ways[0](timeline, self.start(timeline), rule)

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
        """Return the sums of each run, with its own of ``estimators`` and ``adaptations``; it finds no attitude."""
        from jerkbench.kinematic.plugin_call import compiled_rule

        results: list[Streamed | None] = [None] * len(runs)
        every = enumerate(zip(adaptations, runs, strict=True))
        rules = {k: rule for k, (a, run) in every if (rule := compiled_rule(clocked(a, run.timeline))) is not None}
        ways = [way for k in rules if (way := estimators[k].compiled_ways()) is not None]
        if not ways or len(ways) < len(rules):
            return results
        compiled_runs = [Run(runs[k].timeline, runs[k].scoring) for k in rules]
        starts = [estimators[k].start(runs[k].timeline) for k in rules]
        streamed = ways[0][1](compiled_runs, starts, list(rules.values()), updates=updates, threads=threads)
        for k, result in zip(rules, streamed, strict=True):
            results[k] = result
        return results


# The adaptations that an estimator can take.

BEYOND_R = (Fading, AdaptingPrior, AdaptingGain)
"""What an adaptation changes besides R: it needs the one prior covariance of one linear filter."""


def of_r_alone() -> tuple[str, ...]:
    """Names of all adaptations, also a third party's, that change R alone."""
    return _without(BEYOND_R)


def of_r_or_fading() -> tuple[str, ...]:
    """Names of all that change R, or fade the prior covariance."""
    return _without((AdaptingPrior, AdaptingGain))


def _without(contracts: tuple[type, ...]) -> tuple[str, ...]:
    names = plugins.names("adaptation")
    return tuple(name for name in names if not _keeps(plugins.get("adaptation", name), contracts))


@cache
def _keeps(adaptation: type, contracts: tuple[type, ...]) -> bool:
    """Whether the class has any of the contracts: asked of each cell of a sweep, and slow to find out."""
    return isinstance(adaptation, contracts)


# The ranges and origins that the noises of several filters share.

ACCEL_RANGE = Range(
    0.01,
    10.0,
    log=True,
    source="ours: from half of the simulated accelerometer's noise to the best of the baseline on a real car",
)
JERK_WALK = Range(0.1, 100.0, log=True, source="ours: that of the bias walk, times 2/dt at 100 Hz, without its ends")
BIAS_WALK = Range(1e-4, 1.0, log=True, source="ours: from a good MEMS sensor's wandering bias to leaking gravity")
ACCEL_WALK = Range(0.05, 50.0, log=True, source="ours: from a ship's to a race car's changes of acceleration")
VELOCITY_WALK = Range(0.01, 30.0, log=True, source="ours: from a slow robot's to a braking car's changes of velocity")
STAYS = Range(0.5, 0.999, toward_one=True, source="ours: from a model that lasts two updates to one that lasts 1000")

FIELD = DefaultOrigin("tuned by hand on the simulated field; the paper gives no value")
START = DefaultOrigin("ours: wide enough not to matter after the first seconds of the simulated field")
WALK = DefaultOrigin("ours: a vehicle that changes its acceleration by 2 m/s2 within a second")
