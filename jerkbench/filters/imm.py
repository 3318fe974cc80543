"""Interacting multiple models: two kinematic filters that share one state."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from jerkbench.adapted_updates import AdaptedUpdates
from jerkbench.arrays import FloatArray
from jerkbench.contracts import Adaptation, Filter
from jerkbench.errors import PluginError, require_known
from jerkbench.estimate import Attitude, Estimate
from jerkbench.filters.common import (
    ACCEL_RANGE,
    ACCEL_WALK,
    BIAS_WALK,
    JERK_WALK,
    STAYS,
    CompiledWays,
    OverTimelines,
    StepModels,
    initial,
    of_r_alone,
)
from jerkbench.filters.kinematic import Acceleration, Baseline, Bias, Jerk
from jerkbench.kalman import is_healthy, squared_distance, updated
from jerkbench.parameters import NOT_NEGATIVE, DefaultOrigin, Limit, Limited, Provenance
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.timeline import Timeline, build_timeline

if TYPE_CHECKING:
    from jerkbench.kinematic.mixture import Mixed  # what it imports takes half a second

_MODELS = ("acceleration", "baseline", "bias", "jerk")
BETWEEN_0_AND_1 = Limit(lambda p: 0 < p < 1, "it must lie between 0 and 1.")
TWENTY_UPDATES = DefaultOrigin("ours: a model lasts 20 updates")
OF_ITSELF = DefaultOrigin("that of the filter by itself")


@register("filter", "imm")
@dataclass(frozen=True)
class InteractingMultipleModels(Limited, OverTimelines):
    """Two kinematic filters side by side, mixed at each update by how well each explains the measurements.

    With mode probabilities mu and transition probabilities Pi, one cycle, which is an update and the steps to it::

        c_j = sum_i Pi_ij mu_i,  w_ij = Pi_ij mu_i/c_j
        x0_j = sum_i w_ij x_i,   P0_j = sum_i w_ij (P_i + (x_i - x0_j)(x_i - x0_j)')
        each filter on its own: predict every step, then update, with its likelihood L_j = N(y_j; 0, S_j)
        mu_j = c_j L_j/sum_k c_k L_k
        x = sum_j mu_j x_j,      P = sum_j mu_j (P_j + (x_j - x)(x_j - x)')

    Between two updates the weights are c. Pi is that of one update, whatever the time since the last.

    Both filters have the state of the larger one. The baseline next to a nine-state filter gets its third state as a
    row that is inert: it neither acts on position and velocity nor changes, [[1, dt, 0], [0, 1, 0], [0, 0, 1]] with no
    noise on it; mixing alone carries it over. Two filters whose third states mean different things (a jerk, a bias, an
    acceleration) cannot be mixed; one model twice, with two noises, can.

    Good where the vehicle has two manners of moving that last for several updates; with little difference between the
    models the probabilities stay near those of Pi alone. The reported NIS is that of the combined prediction.

    An adaptation sees the innovation of the combined prediction, with its H P H', and both filters get the R that it
    says, so that their likelihoods are of the same measurement; where it drops all rows there is no cycle. It takes
    every adaptation that changes R alone: a prior of one filter is not that of a mixture.

    Source: H. A. P. Blom, Y. Bar-Shalom, "The interacting multiple model algorithm for systems with Markovian
    switching coefficients", IEEE Trans. Automatic Control 33(8), 1988, doi:10.1109/9.1299.

    Attributes:
        first: first kinematic filter: acceleration, baseline, bias or jerk.
        second: second one, of the same names.
        first_stays: probability that the first model is still the right one at the next update [-].
        second_stays: the same for the second [-].
        first_probability: probability that the first is right at the start [-].
        first_accel_mps2: sigma_a of the first, noise of one sample of u [m/s2].
        second_accel_mps2: sigma_a of the second [m/s2].
        jerk_mps3_per_sqrt_s: sigma_j of a jerk filter [m/s3/sqrt(s)].
        initial_jerk_mps3: one sigma of the jerk at the start [m/s3].
        bias_mps2_per_sqrt_s: sigma_b of a bias filter [m/s2/sqrt(s)].
        initial_bias_mps2: one sigma of the bias at the start [m/s2].
        first_walk_mps2_per_sqrt_s: sigma_w of the first, if it is an acceleration filter [m/s2/sqrt(s)].
        second_walk_mps2_per_sqrt_s: sigma_w of the second, likewise [m/s2/sqrt(s)].
        initial_accel_mps2: one sigma of the acceleration at the start, of an acceleration filter [m/s2].
    """

    provenance = Provenance("published", "doi:10.1109/9.1299")

    first: str = "baseline"
    second: str = "jerk"
    first_stays: Annotated[float, STAYS, TWENTY_UPDATES, BETWEEN_0_AND_1] = 0.95
    second_stays: Annotated[float, STAYS, TWENTY_UPDATES, BETWEEN_0_AND_1] = 0.95
    first_probability: Annotated[float, DefaultOrigin("ours: neither is preferred"), BETWEEN_0_AND_1] = 0.5
    first_accel_mps2: Annotated[float, ACCEL_RANGE, OF_ITSELF, NOT_NEGATIVE] = 0.2
    second_accel_mps2: Annotated[float, ACCEL_RANGE, OF_ITSELF, NOT_NEGATIVE] = 0.1
    jerk_mps3_per_sqrt_s: Annotated[float, JERK_WALK, OF_ITSELF, NOT_NEGATIVE] = 6.0
    initial_jerk_mps3: Annotated[float, OF_ITSELF, NOT_NEGATIVE] = 20.0
    bias_mps2_per_sqrt_s: Annotated[float, BIAS_WALK, OF_ITSELF, NOT_NEGATIVE] = 0.03
    initial_bias_mps2: Annotated[float, OF_ITSELF, NOT_NEGATIVE] = 0.1
    first_walk_mps2_per_sqrt_s: Annotated[float, ACCEL_WALK, OF_ITSELF, NOT_NEGATIVE] = 2.0
    second_walk_mps2_per_sqrt_s: Annotated[
        float, ACCEL_WALK, DefaultOrigin("ours: a tenth of the first, for calm driving"), NOT_NEGATIVE
    ] = 0.2
    initial_accel_mps2: Annotated[float, OF_ITSELF, NOT_NEGATIVE] = 1.0

    def __post_init__(self) -> None:
        """Check the limits and the pair of models."""
        super().__post_init__()
        for name in (self.first, self.second):
            require_known("model of filter imm", name, _MODELS)
        if len({self.first, self.second} - {"baseline"}) > 1:
            raise PluginError(
                f"imm cannot mix {self.first} with {self.second}, whose third states mean different things; pair either"
                " of them with baseline, or with itself."
            )

    @property
    def adaptations(self) -> tuple[str, ...]:
        """Names of the adaptations that it accepts: all that change R alone."""
        return of_r_alone()

    @property
    def uses_imu(self) -> bool:
        """Whether one of the two filters takes the IMU's acceleration."""
        return {self.first, self.second} != {"acceleration"}

    def models(self) -> tuple[Filter, Filter]:
        """Return the two filters, with states of the same length."""
        first = self._model(self.first, self.first_accel_mps2, self.first_walk_mps2_per_sqrt_s)
        second = self._model(self.second, self.second_accel_mps2, self.second_walk_mps2_per_sqrt_s)
        return embedded(first, like=second), embedded(second, like=first)

    def transitions(self) -> FloatArray:
        """Return Pi (2, 2)."""
        return np.array(
            [
                [self.first_stays, 1.0 - self.first_stays],
                [1.0 - self.second_stays, self.second_stays],
            ]
        )

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the combined solution at the reference's stamps."""
        return self._mixture(build_timeline(recording, attitude), adaptation).to_the_end()

    def compiled_ways(self) -> CompiledWays:
        """Return what mixes the filters over one timeline, and over several side by side."""
        from jerkbench.kinematic.mixture import mix_alone, mix_many

        return mix_alone, mix_many

    def _mixture(self, timeline: Timeline, adaptation: Adaptation) -> "Mixture":
        return Mixture(timeline, self.models(), self.transitions(), self._probabilities(), adaptation)

    def _probabilities(self) -> FloatArray:
        return np.array([self.first_probability, 1.0 - self.first_probability])

    def start(self, timeline: Timeline) -> "Mixed":
        """Return the filters with their mixed states at the start of a timeline."""
        from jerkbench.kinematic.mixture import Mixed

        models, transitions = self.models(), self.transitions()
        x, P, weights = mixed_start(timeline, models, transitions, self._probabilities())
        return Mixed(models, transitions, weights, x, P)

    def _model(self, name: str, accel_mps2: float, walk_mps2_per_sqrt_s: float) -> Filter:
        if name == "baseline":
            return Baseline(accel_mps2)
        if name == "acceleration":
            return Acceleration(walk_mps2_per_sqrt_s, self.initial_accel_mps2)
        if name == "jerk":
            return Jerk(accel_mps2, self.jerk_mps3_per_sqrt_s, self.initial_jerk_mps3)
        return Bias(accel_mps2, self.bias_mps2_per_sqrt_s, self.initial_bias_mps2)


# Kinematic filters that run side by side and are mixed at each update: the algorithm of `imm`.


@dataclass(frozen=True)
class WithInertState:
    """The baseline with a third state that does nothing.

    Attributes:
        baseline: the filter itself.
        variance: initial variance of the third state, that of the filter it is mixed with.
    """

    baseline: Filter
    variance: float

    def axis_model(self, dt: float, dt0: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A (3, 3), b (3,), Q (3, 3) for a step of ``dt`` seconds."""
        A, b, Q = np.eye(3), np.zeros(3), np.zeros((3, 3))
        A[:2, :2], b[:2], Q[:2, :2] = self.baseline.axis_model(dt, dt0)
        return A, b, Q

    def initial_variances(self) -> FloatArray:
        """Return (1,) the variance of the third state."""
        return np.array([self.variance])


def embedded(model: Filter, like: Filter) -> Filter:
    """Return ``model`` with as many states as ``like``, or itself where it has them."""
    wanted = like.initial_variances()
    return model if len(model.initial_variances()) >= len(wanted) else WithInertState(model, float(wanted[0]))


def mixed_start(
    timeline: Timeline, models: Sequence[Filter], transitions: FloatArray, mu: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the mixed states (k, n), covariances (k, n, n) and weights c (k,) of k filters at the start."""
    starts = [initial(timeline, model) for model in models]
    return mixed(np.array([x for x, _ in starts]), np.array([P for _, P in starts]), mu, transitions)


class Mixture:
    """The state of one run: the filters and the weights c of the mixed states."""

    def __init__(
        self,
        timeline: Timeline,
        models: Sequence[Filter],
        transitions: FloatArray,
        mu: FloatArray,
        adaptation: Adaptation,
    ) -> None:
        """Start all filters from the timeline's start."""
        self.timeline, self.transitions = timeline, transitions
        self.models = [StepModels(model, timeline.dt0_s) for model in models]
        self.x, self.P, self.weights = mixed_start(timeline, models, transitions, mu)
        self.updates, self.healthy = AdaptedUpdates(timeline, adaptation), True

    def to_the_end(self) -> Estimate:
        """Go through the timeline; stops at the first sign of divergence."""
        t, recorder = self.timeline, self.updates.recorder
        steps = zip(t.dt_s.tolist(), t.sample.tolist(), t.update.tolist(), t.reference.tolist(), strict=True)
        for k, (dt, sample, update, reference) in enumerate(steps):
            if dt > 0:
                self._predict(dt, t.accel_enu_mps2[sample])
            if update >= 0:
                self._update(update)
            if not self.healthy:
                return recorder.estimate(f"the covariance is no longer positive definite at {t.t_s[k]:.2f} s")
            if reference >= 0:
                x, P = combined(self.x, self.P, self.weights)
                recorder.state(reference, x[:6], P[:6, :6])
        return recorder.estimate()

    def _predict(self, dt: float, u: FloatArray) -> None:
        for j, models in enumerate(self.models):
            F, B, Q = models.of(dt)
            self.x[j], self.P[j] = F @ self.x[j] + B @ u, F @ self.P[j] @ F.T + Q

    def _update(self, update: int) -> None:
        """Adapt R by the combined prediction, update all filters; weigh and mix them if all are healthy."""
        x, P = combined(self.x, self.P, self.weights)
        _, R, rows = self.updates.take(update, lambda z, rows: (z - x[rows], P[np.ix_(rows, rows)]))
        if not rows.size:
            return
        z = self.timeline.measurements.z[update, rows]
        H, log_likelihood = np.eye(self.x.shape[1])[rows], np.empty(len(self.models))
        for j in range(len(self.models)):
            y = z - self.x[j, rows]
            log_likelihood[j] = log_density(y, self.P[j][np.ix_(rows, rows)] + R)
            self.x[j], self.P[j] = updated(self.x[j], self.P[j], y, H, R)
        self.healthy = all(is_healthy(x, P) for x, P in zip(self.x, self.P, strict=True))
        if self.healthy:
            mu = weighed(self.weights, log_likelihood)
            self.x, self.P, self.weights = mixed(self.x, self.P, mu, self.transitions)


def mixed(
    x: FloatArray, P: FloatArray, mu: FloatArray, transitions: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the mixed states (k, n), covariances (k, n, n) and the weights c (k,) that a cycle begins with."""
    joint = transitions * mu[:, None]
    c = joint.sum(axis=0)
    parts = [combined(x, P, joint[:, j] / c[j]) for j in range(len(c))]
    return np.array([x for x, _ in parts]), np.array([P for _, P in parts]), c


def combined(x: FloatArray, P: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return mean (n,) and covariance (n, n) of a mixture of normal distributions."""
    mean = weights @ x
    deviation = x - mean
    spread = np.einsum("j,ja,jb->ab", weights, deviation, deviation)
    return mean, np.tensordot(weights, P, axes=1) + spread


def weighed(c: FloatArray, log_likelihood: FloatArray) -> FloatArray:
    """Return mu (k,); the largest likelihood is taken out first, so that none underflows to nothing but the smaller."""
    likely = c * np.exp(log_likelihood - log_likelihood.max())
    return np.asarray(likely / likely.sum())


def log_density(y: FloatArray, S: FloatArray) -> float:
    """Return log N(y; 0, S)."""
    log_det = np.linalg.slogdet(S)[1]
    return float(-0.5 * (squared_distance(y, S) + log_det + len(y) * np.log(2.0 * np.pi)))
