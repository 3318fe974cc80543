"""The Rauch-Tung-Striebel smoother over a kinematic filter, with or without the IMU."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, require_not_negative
from jerkbench.contracts import Adaptation, Filter
from jerkbench.errors import PluginError, require_known
from jerkbench.estimate import Attitude, Estimate
from jerkbench.filters.common import (
    ACCEL_RANGE,
    ACCEL_WALK,
    BIAS_WALK,
    FROM_FILTER,
    JERK_WALK,
    VELOCITY_WALK,
    CompiledEstimator,
    CompiledFunctions,
    MeasurementUpdates,
    adaptations_of_r_or_fading,
)
from jerkbench.filters.constant_turn import TURN_WALK, ConstantTurn
from jerkbench.filters.kinematic import Acceleration, Baseline, Bias, ConstantVelocity, Jerk
from jerkbench.kalman import is_healthy
from jerkbench.numpy_run import StepModels, initial
from jerkbench.parameters import Provenance
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.timeline import Timeline, build_timeline

_MODELS = ("baseline", "bias", "jerk")
FIXES_MODELS = ("acceleration", "constant_turn", "constant_velocity")


class Smoother(CompiledEstimator):
    """Base class of the smoothers over kinematic filters. A subclass provides the filter of the forward pass."""

    def kinematic_filter(self) -> Filter | ConstantTurn:
        """Return the filter that the forward pass runs."""
        raise NotImplementedError

    @property
    def adaptations(self) -> tuple[str, ...]:
        """Names of the supported adaptations: all adaptations that change only R or fade the prior covariance P-."""
        return adaptations_of_r_or_fading()

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the smoothed estimate at the time stamps of the reference, up to a divergence of the forward pass."""
        return self.smooth(build_timeline(recording, attitude), adaptation)

    def smooth(self, timeline: Timeline, adaptation: Adaptation) -> Estimate:
        """Smooth the states of a timeline and return the smoothed estimate at the time stamps of the reference."""
        update = MeasurementUpdates(timeline, adaptation)
        forward, failure = _forward(timeline, self.kinematic_filter(), update)
        x, P = smoothed(forward)
        for k in np.flatnonzero(timeline.reference[: len(x)] >= 0).tolist():
            update.recorder.state(int(timeline.reference[k]), x[k, :6], P[k, :6, :6])
        return update.recorder.estimate(failure)

    def compiled_functions(self) -> CompiledFunctions | None:
        """Return the compiled smoothers for one timeline and for a batch of timelines, or None for `constant_turn`."""
        from jerkbench.kinematic.smoother import smooth_many, smooth_one

        return None if isinstance(self.kinematic_filter(), ConstantTurn) else (smooth_one, smooth_many)

    def start(self, timeline: Timeline) -> Filter | ConstantTurn:
        """Return the filter of the forward pass, which the compiled smoother takes as an argument."""
        return self.kinematic_filter()


@register("filter", "rts")
@dataclass(frozen=True)
class RauchTungStriebel(Smoother):
    """The Rauch-Tung-Striebel smoother over a kinematic filter: every estimate uses all measurements.

    The forward pass runs the filter ``model`` with the adaptation. For each time step, the forward pass stores the
    prior state x- and its covariance P-, and the posterior state x and its covariance P. The backward pass starts at
    the last step. In the following equations of the backward pass, F is the transition matrix from step k to step k +
    1::

        G = P F' (P-_{k+1})^-1
        xs = x + G (xs_{k+1} - x-_{k+1})
        Ps = P + G (Ps_{k+1} - P-_{k+1}) G',  symmetrised

    If the model is correct, no filter with the same model has a smaller expected error than the smoother. The
    difference between the errors of the filter and of the smoother shows the benefit of later measurements, which is
    largest in outages. The smoother cannot be used online, and it does not correct a wrong model. The reported
    innovations and NIS are computed in the forward pass. The backward pass uses the adapted R and the faded P- of the
    forward pass. For the backward pass, a faded P- is equivalent to a larger Q. Adaptations that change P- or the gain
    in any other way are not supported.

    The engine `filterpy` runs the reference implementation in NumPy. The reference implementation stores every step,
    which needs 1.4 kB of memory per step with six states and 2.9 kB with nine states. The engine `compiled` runs a
    backward pass with adjoint variables (`jerkbench.kinematic.smoother`), which does not invert P-. The states of the
    two engines agree to 1e-9 m. The covariances of the two engines agree to 1e-12 of sqrt(P_ii P_jj), or to the
    difference that a change in the last bits of the input causes in the inverse of P-. In a gap between measurements,
    both engines subtract nearly equal covariances. The rounding errors of Ps in a gap are about 1e-12 of the filtered
    P, which can be hundreds of times larger than Ps. Compared with extended precision, the relative error of Ps after a
    gap of 4 s is up to 1e-10 in `compiled` and up to 6e-12 in `filterpy`. If the filtered P is even larger, `compiled`
    is more accurate than `filterpy`. The rounding errors of the filtered P are also about 1e-12 of the filtered P.

    Source: H. E. Rauch, F. Tung, C. T. Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA
    Journal 3(8), 1965, doi:10.2514/3.3166.

    Attributes:
        model: name of the kinematic filter: baseline, bias or jerk. Parameters that the kinematic filter ``model`` does
            not have are ignored.
        accel_mps2: sigma_a, noise of one sample of the acceleration u [m/s2].
        jerk_mps3_per_sqrt_s: sigma_j, intensity of the random walk of the jerk [m/s3/sqrt(s)].
        initial_jerk_mps3: standard deviation of the initial jerk [m/s3].
        bias_mps2_per_sqrt_s: sigma_b, intensity of the random walk of the bias [m/s2/sqrt(s)].
        initial_bias_mps2: standard deviation of the initial bias [m/s2].
    """

    provenance = Provenance("published", "doi:10.2514/3.3166")

    model: str = "bias"
    accel_mps2: Annotated[float, ACCEL_RANGE, FROM_FILTER] = 0.1
    jerk_mps3_per_sqrt_s: Annotated[float, JERK_WALK, FROM_FILTER] = 6.0
    initial_jerk_mps3: Annotated[float, FROM_FILTER] = 20.0
    bias_mps2_per_sqrt_s: Annotated[float, BIAS_WALK, FROM_FILTER] = 0.03
    initial_bias_mps2: Annotated[float, FROM_FILTER] = 0.1

    def __post_init__(self) -> None:
        if self.model in FIXES_MODELS:
            raise PluginError(
                f"filter=rts does not support the model {self.model}; use filter=rts_fixes filter.model={self.model}."
            )
        require_known("model of filter rts", self.model, _MODELS)
        require_not_negative("filter rts", self, list(vars(self))[1:])

    def kinematic_filter(self) -> Filter:
        """Return the filter ``model`` with the parameters of this smoother."""
        if self.model == "baseline":
            return Baseline(self.accel_mps2)
        if self.model == "jerk":
            return Jerk(self.accel_mps2, self.jerk_mps3_per_sqrt_s, self.initial_jerk_mps3)
        return Bias(self.accel_mps2, self.bias_mps2_per_sqrt_s, self.initial_bias_mps2)


@register("filter", "rts_fixes")
@dataclass(frozen=True)
class SmoothedFixes(Smoother):
    """The Rauch-Tung-Striebel smoother over position fixes without the IMU: every estimate uses all fixes.

    The equations are the same as in `rts`, but the filter of the forward pass does not use the measured acceleration.
    With the model `constant_turn`, the smoother is an extended Kalman smoother, in which F is the Jacobian at the
    filtered state. The command `jerkbench smooth` tunes this smoother on a log and writes the smoothed track to a GPX
    file.

    Source: H. E. Rauch, F. Tung, C. T. Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA
    Journal 3(8), 1965, doi:10.2514/3.3166.

    Attributes:
        model: name of the kinematic filter: acceleration, constant_turn or constant_velocity. Parameters that the
            kinematic filter ``model`` does not have are ignored.
        velocity_walk_mps_per_sqrt_s: q, intensity of the random walk of the velocity [m/s/sqrt(s)].
        turn_walk_radps_per_sqrt_s: q_w, intensity of the random walk of the turn rate [rad/s/sqrt(s)].
        initial_turn_radps: standard deviation of the initial turn rate [rad/s].
        accel_walk_mps2_per_sqrt_s: sigma_w, intensity of the random walk of the acceleration [m/s2/sqrt(s)].
        initial_accel_mps2: standard deviation of the initial acceleration [m/s2].
    """

    provenance = Provenance("published", "doi:10.2514/3.3166")

    uses_imu: ClassVar[bool] = False

    model: str = "constant_velocity"
    velocity_walk_mps_per_sqrt_s: Annotated[float, VELOCITY_WALK, FROM_FILTER] = 1.0
    turn_walk_radps_per_sqrt_s: Annotated[float, TURN_WALK, FROM_FILTER] = 0.05
    initial_turn_radps: Annotated[float, FROM_FILTER] = 0.1
    accel_walk_mps2_per_sqrt_s: Annotated[float, ACCEL_WALK, FROM_FILTER] = 2.0
    initial_accel_mps2: Annotated[float, FROM_FILTER] = 1.0

    def __post_init__(self) -> None:
        require_known("model of filter rts_fixes", self.model, FIXES_MODELS)
        require_not_negative("filter rts_fixes", self, list(vars(self))[1:])

    def kinematic_filter(self) -> Filter | ConstantTurn:
        """Return the filter ``model`` with the parameters of this smoother."""
        if self.model == "acceleration":
            return Acceleration(self.accel_walk_mps2_per_sqrt_s, self.initial_accel_mps2)
        if self.model == "constant_velocity":
            return ConstantVelocity(self.velocity_walk_mps_per_sqrt_s)
        return ConstantTurn(self.velocity_walk_mps_per_sqrt_s, self.turn_walk_radps_per_sqrt_s, self.initial_turn_radps)


class ForwardPass(NamedTuple):
    """The states and covariances of the forward pass at each of n time steps, with s states.

    Attributes:
        x: (n, s) posterior states, after the update of each step.
        P: (n, s, s) posterior covariances of ``x``.
        x_prior: (n, s) prior states, before the update of each step.
        P_prior: (n, s, s) prior covariances of ``x_prior``, including the fading factor of the adaptation.
        F: list of n transition matrices (s, s), each from the previous step to this step. The first of the matrices is
            not used.
    """

    x: FloatArray
    P: FloatArray
    x_prior: FloatArray
    P_prior: FloatArray
    F: list[FloatArray]

    def until(self, k: int) -> "ForwardPass":
        """Return the results of the first ``k`` time steps."""
        return ForwardPass(self.x[:k], self.P[:k], self.x_prior[:k], self.P_prior[:k], self.F[:k])


def smoothed(forward: ForwardPass) -> tuple[FloatArray, FloatArray]:
    """Run the backward pass and return the smoothed states x (n, s) and their covariances P (n, s, s)."""
    x, P = forward.x.copy(), forward.P.copy()
    for k in range(len(x) - 2, -1, -1):
        prior = forward.P_prior[k + 1]
        G = np.linalg.solve(prior, forward.F[k + 1] @ P[k]).T
        x[k] += G @ (x[k + 1] - forward.x_prior[k + 1])
        later = P[k] + G @ (P[k + 1] - prior) @ G.T
        P[k] = 0.5 * (later + later.T)
    return x, P


Predict = Callable[[FloatArray, FloatArray, float, FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""A function of x, P, the step length [s] and the input u that returns x and P after the step, and F."""


def _start(timeline: Timeline, model: Filter | ConstantTurn) -> tuple[FloatArray, FloatArray, Predict]:
    """Return the initial x and P of the filter, and the function that predicts one time step."""
    if isinstance(model, ConstantTurn):
        return *model.start(timeline), lambda x, P, dt, _: model.predicted(x, P, dt)
    return *initial(timeline, model), StepModels(model, timeline.dt0_s).predicted


def _forward(timeline: Timeline, model: Filter | ConstantTurn, update: MeasurementUpdates) -> tuple[ForwardPass, str]:
    """Run the forward pass, and return its results and the reason for a divergence of the filter.

    If the filter diverges, the results end before the step of the divergence. If the filter does not diverge, the
    returned reason is an empty string.
    """
    x, P, predicted = _start(timeline, model)
    n, s = len(timeline.dt_s), len(x)
    forward = ForwardPass(np.empty((n, s)), np.empty((n, s, s)), np.empty((n, s)), np.empty((n, s, s)), [np.eye(s)] * n)
    for k, (dt, sample) in enumerate(zip(timeline.dt_s.tolist(), timeline.sample.tolist(), strict=True)):
        if dt > 0:
            x, P, forward.F[k] = predicted(x, P, dt, timeline.accel_enu_mps2[sample])
        forward.x_prior[k], forward.P_prior[k] = x, P
        row = int(timeline.update[k])
        if row >= 0:
            x, P, forward.P_prior[k] = update(row, x, P)
            if not is_healthy(x, P):
                return forward.until(k), f"the covariance is no longer positive definite at {timeline.t_s[k]:.2f} s"
        forward.x[k], forward.P[k] = x, P
    return forward, ""
