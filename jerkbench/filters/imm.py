"""The interacting multiple model (IMM) estimator with two kinematic filters."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Adaptation, Filter
from jerkbench.errors import PluginError, require_known
from jerkbench.estimate import Attitude, Estimate
from jerkbench.filters.common import (
    ACCEL_RANGE,
    ACCEL_WALK,
    BIAS_WALK,
    FROM_FILTER,
    JERK_WALK,
    STAYS,
    AdaptedR,
    CompiledEstimator,
    CompiledFunctions,
)
from jerkbench.filters.kinematic import Acceleration, Baseline, Bias, Jerk
from jerkbench.kalman import is_healthy, squared_distance, updated
from jerkbench.numpy_run import AdaptedUpdates, StepModels, initial
from jerkbench.parameters import BETWEEN_0_AND_1, NOT_NEGATIVE, DefaultOrigin, Limited, Provenance
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.timeline import Timeline, build_timeline

if TYPE_CHECKING:
    from jerkbench.kinematic.mixture import Mixed  # importing this module takes half a second

_MODELS = ("acceleration", "baseline", "bias", "jerk")
TWENTY_UPDATES = DefaultOrigin("ours: a model lasts 20 updates")


@register("filter", "imm")
@dataclass(frozen=True)
class InteractingMultipleModels(Limited, AdaptedR, CompiledEstimator):
    """Two kinematic filters run in parallel, and each update weights them by the likelihood of the measurement.

    A cycle consists of a measurement update and the prediction steps before this update. In the following equations of
    one cycle, mu are the mode probabilities and Pi are the transition probabilities::

        c_j = sum_i Pi_ij mu_i,  w_ij = Pi_ij mu_i/c_j
        x0_j = sum_i w_ij x_i,   P0_j = sum_i w_ij (P_i + (x_i - x0_j)(x_i - x0_j)')
        each filter separately: predict every step, then update, with the likelihood L_j = N(y_j; 0, S_j)
        mu_j = c_j L_j/sum_k c_k L_k
        x = sum_j mu_j x_j,      P = sum_j mu_j (P_j + (x_j - x)(x_j - x)')

    Between two updates, the mode probabilities are the predicted probabilities c_j. The matrix Pi is applied once per
    update and does not depend on the time between updates.

    Both filters need the same number of states. If `baseline` is paired with a nine-state filter, `baseline` is
    extended by an inert third state per axis, with A = [[1, dt, 0], [0, 1, 0], [0, 0, 1]]. The inert state has no
    process noise and does not affect position and velocity. Only the mixing changes the inert state. Two filters whose
    third states have different meanings (jerk, bias, acceleration) cannot be mixed. Both filters may use the same model
    with different noise parameters.

    The estimator works well if the vehicle has two modes of motion that last for several updates each. If the two
    models are similar, the mode probabilities remain near the stationary probabilities of Pi. The reported NIS is
    computed from the combined prediction of both filters.

    If R is much too small, the estimator amplifies rounding errors: a likelihood ratio of e^100 makes the mode
    probabilities jump between 0 and 1. On such a drive, a change in the last bit of the measurements can change the
    estimate by some decimetres, so the results of two engines or of two versions of a library differ as much.

    An adaptation receives the innovation and the covariance H P H' of the combined prediction. Both filters use the
    adapted R, so their likelihoods are comparable. If the adaptation drops all rows of a measurement, the update and
    the mixing are skipped. All adaptations that change only R are supported. Adaptations of the prior covariance are
    not supported, because each of the two filters has a separate prior.

    Source: H. A. P. Blom, Y. Bar-Shalom, "The interacting multiple model algorithm for systems with Markovian
    switching coefficients", IEEE Trans. Automatic Control 33(8), 1988, doi:10.1109/9.1299.

    Attributes:
        first: name of the first kinematic filter: acceleration, baseline, bias or jerk.
        second: name of the second kinematic filter: acceleration, baseline, bias or jerk.
        first_stays: Pi_11, probability that the first model remains valid until the next update [-].
        second_stays: Pi_22, probability that the second model remains valid until the next update [-].
        first_probability: initial mu_1, probability that the first model is valid at the start [-].
        first_accel_mps2: sigma_a of the first filter, noise of one sample of the acceleration u [m/s2].
        second_accel_mps2: sigma_a of the second filter, noise of one sample of the acceleration u [m/s2].
        jerk_mps3_per_sqrt_s: sigma_j of a jerk filter, intensity of the random walk of the jerk [m/s3/sqrt(s)].
        initial_jerk_mps3: standard deviation of the initial jerk [m/s3].
        bias_mps2_per_sqrt_s: sigma_b of a bias filter, intensity of the random walk of the bias [m/s2/sqrt(s)].
        initial_bias_mps2: standard deviation of the initial acceleration bias [m/s2].
        first_walk_mps2_per_sqrt_s: sigma_w, intensity of the random walk of the acceleration in the first filter, if
            that filter is `acceleration` [m/s2/sqrt(s)].
        second_walk_mps2_per_sqrt_s: sigma_w, intensity of the random walk of the acceleration in the second filter, if
            that filter is `acceleration` [m/s2/sqrt(s)].
        initial_accel_mps2: standard deviation of the initial acceleration in an `acceleration` filter [m/s2].
    """

    provenance = Provenance("published", "doi:10.1109/9.1299")

    first: str = "baseline"
    second: str = "jerk"
    first_stays: Annotated[float, STAYS, TWENTY_UPDATES, BETWEEN_0_AND_1] = 0.95
    second_stays: Annotated[float, STAYS, TWENTY_UPDATES, BETWEEN_0_AND_1] = 0.95
    first_probability: Annotated[float, DefaultOrigin("ours: neither is preferred"), BETWEEN_0_AND_1] = 0.5
    first_accel_mps2: Annotated[float, ACCEL_RANGE, FROM_FILTER, NOT_NEGATIVE] = 0.2
    second_accel_mps2: Annotated[float, ACCEL_RANGE, FROM_FILTER, NOT_NEGATIVE] = 0.1
    jerk_mps3_per_sqrt_s: Annotated[float, JERK_WALK, FROM_FILTER, NOT_NEGATIVE] = 6.0
    initial_jerk_mps3: Annotated[float, FROM_FILTER, NOT_NEGATIVE] = 20.0
    bias_mps2_per_sqrt_s: Annotated[float, BIAS_WALK, FROM_FILTER, NOT_NEGATIVE] = 0.03
    initial_bias_mps2: Annotated[float, FROM_FILTER, NOT_NEGATIVE] = 0.1
    first_walk_mps2_per_sqrt_s: Annotated[float, ACCEL_WALK, FROM_FILTER, NOT_NEGATIVE] = 2.0
    second_walk_mps2_per_sqrt_s: Annotated[
        float, ACCEL_WALK, DefaultOrigin("ours: a tenth of the first, for calm driving"), NOT_NEGATIVE
    ] = 0.2
    initial_accel_mps2: Annotated[float, FROM_FILTER, NOT_NEGATIVE] = 1.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in (self.first, self.second):
            require_known("model of filter imm", name, _MODELS)
        if len({self.first, self.second} - {"baseline"}) > 1:
            raise PluginError(
                f"imm cannot mix {self.first} with {self.second}, because their third states have different meanings;"
                " combine each of these models only with baseline or with itself."
            )

    @property
    def uses_imu(self) -> bool:
        """True if at least one of the two filters uses the acceleration that the IMU measures."""
        return {self.first, self.second} != {"acceleration"}

    def models(self) -> tuple[Filter, Filter]:
        """Return the two filters, with states of the same dimension."""
        first = self._model(self.first, self.first_accel_mps2, self.first_walk_mps2_per_sqrt_s)
        second = self._model(self.second, self.second_accel_mps2, self.second_walk_mps2_per_sqrt_s)
        return embedded(first, like=second), embedded(second, like=first)

    def transitions(self) -> FloatArray:
        """Return the matrix Pi (2, 2) of transition probabilities."""
        return np.array([[self.first_stays, 1.0 - self.first_stays], [1.0 - self.second_stays, self.second_stays]])

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the combined estimate of both filters at the time stamps of the reference."""
        return self._mixture(build_timeline(recording, attitude), adaptation).run()

    def compiled_functions(self) -> CompiledFunctions:
        """Return the compiled IMM function for one timeline and the compiled IMM function for a batch of timelines."""
        from jerkbench.kinematic.mixture import mix_many, mix_single

        return mix_single, mix_many

    def _mixture(self, timeline: Timeline, adaptation: Adaptation) -> "Mixture":
        return Mixture(timeline, self.models(), self.transitions(), self._probabilities(), adaptation)

    def _probabilities(self) -> FloatArray:
        return np.array([self.first_probability, 1.0 - self.first_probability])

    def start(self, timeline: Timeline) -> "Mixed":
        """Return the two filters with their mixed states at the start of a timeline."""
        models, transitions = self.models(), self.transitions()
        x, P, weights = mixed_start(timeline, models, transitions, self._probabilities())
        return models, x, P, transitions, weights

    def _model(self, name: str, accel_mps2: float, walk_mps2_per_sqrt_s: float) -> Filter:
        if name == "baseline":
            return Baseline(accel_mps2)
        if name == "acceleration":
            return Acceleration(walk_mps2_per_sqrt_s, self.initial_accel_mps2)
        if name == "jerk":
            return Jerk(accel_mps2, self.jerk_mps3_per_sqrt_s, self.initial_jerk_mps3)
        return Bias(accel_mps2, self.bias_mps2_per_sqrt_s, self.initial_bias_mps2)


@dataclass(frozen=True)
class WithInertState:
    """The filter `baseline` with an additional third state per axis that is constant and has no effect.

    Attributes:
        baseline: the filter with two states per axis.
        variance: initial variance of the third state, equal to the initial variance in the other filter of the mixture.
    """

    baseline: Filter
    variance: float

    def axis_model(self, dt: float, dt0: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A (3, 3), b (3,) and Q (3, 3) of one axis for a step of ``dt`` seconds."""
        A, b, Q = np.eye(3), np.zeros(3), np.zeros((3, 3))
        A[:2, :2], b[:2], Q[:2, :2] = self.baseline.axis_model(dt, dt0)
        return A, b, Q

    def initial_variances(self) -> FloatArray:
        """Return an array (1,) with the initial variance of the third state."""
        return np.array([self.variance])


def embedded(model: Filter, like: Filter) -> Filter:
    """Return ``model`` with at least as many states as ``like``. An inert state is added if necessary."""
    required = like.initial_variances()
    return model if len(model.initial_variances()) >= len(required) else WithInertState(model, float(required[0]))


def mixed_start(
    timeline: Timeline, models: Sequence[Filter], transitions: FloatArray, mu: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the mixed initial states (k, n), their covariances (k, n, n) and the weights c (k,) of k filters."""
    starts = [initial(timeline, model) for model in models]
    return mixed(np.array([x for x, _ in starts]), np.array([P for _, P in starts]), mu, transitions)


class Mixture:
    """One run of the IMM estimator: the filters, their mixed states, and the mode probabilities c."""

    def __init__(
        self,
        timeline: Timeline,
        models: Sequence[Filter],
        transitions: FloatArray,
        mu: FloatArray,
        adaptation: Adaptation,
    ) -> None:
        """Initialise all filters at the start of the timeline.

        Args:
            timeline: time steps and measurements of the run.
            models: k filters with states of the same dimension.
            transitions: (k, k) transition probabilities Pi.
            mu: (k,) mode probabilities at the start.
            adaptation: adaptation of the measurement covariance R.
        """
        self.timeline, self.transitions = timeline, transitions
        self.models = [StepModels(model, timeline.dt0_s) for model in models]
        self.x, self.P, self.weights = mixed_start(timeline, models, transitions, mu)
        self.updates, self.healthy = AdaptedUpdates(timeline, adaptation), True

    def run(self) -> Estimate:
        """Return the combined estimate of the run, up to a step at which a covariance is not positive definite."""
        t, recorder = self.timeline, self.updates.recorder
        steps = zip(t.dt_s.tolist(), t.sample.tolist(), t.update.tolist(), t.reference.tolist(), strict=True)
        for k, (dt, sample, update, reference) in enumerate(steps):
            if dt > 0:
                u = t.accel_enu_mps2[sample]
                for j, models in enumerate(self.models):
                    self.x[j], self.P[j], _ = models.predicted(self.x[j], self.P[j], dt, u)
            if update >= 0:
                self._update(update)
            if not self.healthy:
                return recorder.estimate(f"the covariance is no longer positive definite at {t.t_s[k]:.2f} s")
            if reference >= 0:
                x, P = combined(self.x, self.P, self.weights)
                recorder.state(reference, x[:6], P[:6, :6])
        return recorder.estimate()

    def _update(self, update: int) -> None:
        """Adapt R with the combined prediction, update both filters, and mix them if their covariances are valid."""
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
    """Return the mixed states (k, n), covariances (k, n, n) and weights c (k,) at the start of an IMM cycle."""
    joint = transitions * mu[:, None]
    c = joint.sum(axis=0)
    parts = [combined(x, P, joint[:, j] / c[j]) for j in range(len(c))]
    return np.array([x for x, _ in parts]), np.array([P for _, P in parts]), c


def combined(x: FloatArray, P: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean (n,) and the covariance (n, n) of a mixture of k normal distributions with ``weights`` (k,)."""
    mean = weights @ x
    deviation = x - mean
    spread = np.einsum("j,ja,jb->ab", weights, deviation, deviation)
    return mean, np.tensordot(weights, P, axes=1) + spread


def weighed(c: FloatArray, log_likelihood: FloatArray) -> FloatArray:
    """Return the mode probabilities mu (k,) from the weights c (k,) and the log likelihoods (k,) of k filters.

    The likelihoods are divided by the largest likelihood, so that at least one likelihood does not underflow.
    """
    likely = c * np.exp(log_likelihood - log_likelihood.max())
    return np.asarray(likely / likely.sum())


def log_density(y: FloatArray, S: FloatArray) -> float:
    """Return log N(y; 0, S), the log density of a zero-mean normal distribution with covariance S at y."""
    log_det = np.linalg.slogdet(S)[1]
    return float(-0.5 * (squared_distance(y, S) + log_det + len(y) * np.log(2.0 * np.pi)))
