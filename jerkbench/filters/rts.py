"""The Rauch-Tung-Striebel smoother over a kinematic filter, or over fixes alone: it sees the future."""

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
    JERK_WALK,
    VELOCITY_WALK,
    CompiledWays,
    MeasurementUpdates,
    OverTimelines,
    StepModels,
    initial,
    of_r_or_fading,
)
from jerkbench.filters.constant_turn import TURN_WALK, ConstantTurn
from jerkbench.filters.kinematic import Acceleration, Baseline, Bias, ConstantVelocity, Jerk
from jerkbench.kalman import is_healthy
from jerkbench.parameters import DefaultOrigin, Provenance
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.timeline import Timeline, build_timeline

_MODELS = ("baseline", "bias", "jerk")
OF_FIXES = ("acceleration", "constant_turn", "constant_velocity")
OF_THE_FILTER = DefaultOrigin("that of the filter by itself")


class Smoother(OverTimelines):
    """The smoother, whatever filter it runs over."""

    def kinematic_filter(self) -> Filter | ConstantTurn:
        """Return the filter of the forward pass."""
        raise NotImplementedError

    @property
    def adaptations(self) -> tuple[str, ...]:
        """Names of the adaptations that it accepts: all that change R, or fade P-."""
        return of_r_or_fading()

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the smoothed solution at the reference's stamps; where the forward pass stops, up to there."""
        return self.smooth(build_timeline(recording, attitude), adaptation)

    def smooth(self, timeline: Timeline, adaptation: Adaptation) -> Estimate:
        """Return the smoothed solution of a timeline."""
        update = MeasurementUpdates(timeline, adaptation)
        forward, failure = _forward(timeline, self.kinematic_filter(), update)
        x, P = smoothed(forward)
        for k in np.flatnonzero(timeline.reference[: len(x)] >= 0).tolist():
            update.recorder.state(int(timeline.reference[k]), x[k, :6], P[k, :6, :6])
        return update.recorder.estimate(failure)

    def compiled_ways(self) -> CompiledWays | None:
        """Return what smooths one timeline, and several side by side; of a turn there is no compiled way."""
        from jerkbench.kinematic.smoother import smooth_many, smooth_one

        return None if isinstance(self.kinematic_filter(), ConstantTurn) else (smooth_one, smooth_many)

    def start(self, timeline: Timeline) -> Filter | ConstantTurn:
        """Return the filter of the forward pass, which begins as the timeline says."""
        return self.kinematic_filter()


@register("filter", "rts")
@dataclass(frozen=True)
class RauchTungStriebel(Smoother):
    """The Rauch-Tung-Striebel smoother over a kinematic filter: every estimate knows all measurements, later ones too.

    Forward, the filter ``model`` with the adaptation: x, P after each step of the timeline, x-, P- before its update.
    Backward from the last step, with F from k to k + 1::

        G = P F' (P-_{k+1})^-1
        xs = x + G (xs_{k+1} - x-_{k+1})
        Ps = P + G (Ps_{k+1} - P-_{k+1}) G',  symmetrised

    No filter of the same model can be better: the row tells what waiting for the rest of the recording would gain,
    most of it in outages. It is of no use while driving. A wrong model stays wrong in hindsight, and innovations and
    NIS are those of the forward pass. The covariances R that an adaptation chose are kept as they were, and so is a P-
    that it faded: to the backward pass that is a larger Q. One that chooses P- or the gain otherwise is not accepted.

    The engine `filterpy` runs this in NumPy, the definition of right, and keeps every step: 1.4 kB each with six
    states, 2.9 kB with nine. The engine `compiled` runs the same by adjoints (`jerkbench.kinematic.smoother`), which
    take no inverse of P-, and agrees to 1e-9 m, and to 1e-12 of sqrt(P_ii P_jj) or what the inverse of P- makes of
    changes in the last bits of the input. In a gap both subtract nearly equal covariances, and have errors of 1e-12
    of the filtered P, hundreds of times Ps and more: of Ps after 4 s up to 1e-10 here and 6e-12 in NumPy, against
    extended precision; where P is larger still it is the other way round. The filtered P itself is that uncertain.

    Source: H. E. Rauch, F. Tung, C. T. Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA
    Journal 3(8), 1965, doi:10.2514/3.3166.

    Attributes:
        model: kinematic filter: baseline, bias or jerk. Fields of the other models do nothing.
        accel_mps2: sigma_a, noise of one sample of u [m/s2].
        jerk_mps3_per_sqrt_s: sigma_j, random walk of the jerk [m/s3/sqrt(s)].
        initial_jerk_mps3: one sigma of the jerk at the start [m/s3].
        bias_mps2_per_sqrt_s: sigma_b, random walk of the bias [m/s2/sqrt(s)].
        initial_bias_mps2: one sigma of the bias at the start [m/s2].
    """

    provenance = Provenance("published", "doi:10.2514/3.3166")

    model: str = "bias"
    accel_mps2: Annotated[float, ACCEL_RANGE, OF_THE_FILTER] = 0.1
    jerk_mps3_per_sqrt_s: Annotated[float, JERK_WALK, OF_THE_FILTER] = 6.0
    initial_jerk_mps3: Annotated[float, OF_THE_FILTER] = 20.0
    bias_mps2_per_sqrt_s: Annotated[float, BIAS_WALK, OF_THE_FILTER] = 0.03
    initial_bias_mps2: Annotated[float, OF_THE_FILTER] = 0.1

    def __post_init__(self) -> None:
        """Check the name of the model and the noises, those of the other models too."""
        if self.model in OF_FIXES:
            raise PluginError(f"The model {self.model} uses no IMU: take filter=rts_fixes filter.model={self.model}.")
        require_known("model of filter rts", self.model, _MODELS)
        require_not_negative("filter rts", self, list(vars(self))[1:])

    def kinematic_filter(self) -> Filter:
        """Return the filter of the forward pass."""
        if self.model == "baseline":
            return Baseline(self.accel_mps2)
        if self.model == "jerk":
            return Jerk(self.accel_mps2, self.jerk_mps3_per_sqrt_s, self.initial_jerk_mps3)
        return Bias(self.accel_mps2, self.bias_mps2_per_sqrt_s, self.initial_bias_mps2)


@register("filter", "rts_fixes")
@dataclass(frozen=True)
class SmoothedFixes(Smoother):
    """The Rauch-Tung-Striebel smoother of fixes alone: the IMU is not used, every estimate knows all fixes.

    It is `rts` over one of the filters that take no acceleration. Over `constant_turn` it is the extended smoother: F
    is the Jacobian at the filtered state. `jerkbench smooth` tunes it on the log itself, and writes the track as GPX.

    Source: H. E. Rauch, F. Tung, C. T. Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA
    Journal 3(8), 1965, doi:10.2514/3.3166.

    Attributes:
        model: acceleration, constant_turn or constant_velocity. Fields of the other models do nothing.
        velocity_walk_mps_per_sqrt_s: q, random walk of the velocity [m/s/sqrt(s)].
        turn_walk_radps_per_sqrt_s: q_w, random walk of the rate of turn [rad/s/sqrt(s)].
        initial_turn_radps: one sigma of the rate of turn at the start [rad/s].
        accel_walk_mps2_per_sqrt_s: sigma_w, random walk of the acceleration [m/s2/sqrt(s)].
        initial_accel_mps2: one sigma of the acceleration at the start [m/s2].
    """

    provenance = Provenance("published", "doi:10.2514/3.3166")

    uses_imu: ClassVar[bool] = False

    model: str = "constant_velocity"
    velocity_walk_mps_per_sqrt_s: Annotated[float, VELOCITY_WALK, OF_THE_FILTER] = 1.0
    turn_walk_radps_per_sqrt_s: Annotated[float, TURN_WALK, OF_THE_FILTER] = 0.05
    initial_turn_radps: Annotated[float, OF_THE_FILTER] = 0.1
    accel_walk_mps2_per_sqrt_s: Annotated[float, ACCEL_WALK, OF_THE_FILTER] = 2.0
    initial_accel_mps2: Annotated[float, OF_THE_FILTER] = 1.0

    def __post_init__(self) -> None:
        """Check the name of the model and the noises, those of the other models too."""
        require_known("model of filter rts_fixes", self.model, OF_FIXES)
        require_not_negative("filter rts_fixes", self, list(vars(self))[1:])

    def kinematic_filter(self) -> Filter | ConstantTurn:
        """Return the filter of the forward pass."""
        if self.model == "acceleration":
            return Acceleration(self.accel_walk_mps2_per_sqrt_s, self.initial_accel_mps2)
        if self.model == "constant_velocity":
            return ConstantVelocity(self.velocity_walk_mps_per_sqrt_s)
        return ConstantTurn(self.velocity_walk_mps_per_sqrt_s, self.turn_walk_radps_per_sqrt_s, self.initial_turn_radps)


class ForwardPass(NamedTuple):
    """The results of the forward pass that the backward pass needs, for each of n steps.

    Attributes:
        x: (n, s) after the update.
        P: (n, s, s) its covariance.
        x_prior: (n, s) before the update.
        P_prior: (n, s, s) its covariance, faded where the adaptation did.
        F: n matrices (s, s) that led to the step; the first is not used.
    """

    x: FloatArray
    P: FloatArray
    x_prior: FloatArray
    P_prior: FloatArray
    F: list[FloatArray]

    def until(self, k: int) -> "ForwardPass":
        """Return the first ``k`` steps."""
        return ForwardPass(self.x[:k], self.P[:k], self.x_prior[:k], self.P_prior[:k], self.F[:k])


def smoothed(forward: ForwardPass) -> tuple[FloatArray, FloatArray]:
    """Return the smoothed x (n, s) and P (n, s, s)."""
    x, P = forward.x.copy(), forward.P.copy()
    for k in range(len(x) - 2, -1, -1):
        prior = forward.P_prior[k + 1]
        G = np.linalg.solve(prior, forward.F[k + 1] @ P[k]).T
        x[k] += G @ (x[k + 1] - forward.x_prior[k + 1])
        later = P[k] + G @ (P[k + 1] - prior) @ G.T
        P[k] = 0.5 * (later + later.T)
    return x, P


Predict = Callable[[FloatArray, FloatArray, float, FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
"""x, P, the length of a step and u -> x and P after it, and F."""


def _begin(timeline: Timeline, model: Filter | ConstantTurn) -> tuple[FloatArray, FloatArray, Predict]:
    """Return x and P at the start, and what predicts a step."""
    if isinstance(model, ConstantTurn):
        return *model.start(timeline), lambda x, P, dt, _: model.predicted(x, P, dt)
    models = StepModels(model, timeline.dt0_s)

    def predicted(x: FloatArray, P: FloatArray, dt: float, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        F, B, Q = models.of(dt)
        return F @ x + B @ u, F @ P @ F.T + Q, F

    return *initial(timeline, model), predicted


def _forward(timeline: Timeline, model: Filter | ConstantTurn, update: MeasurementUpdates) -> tuple[ForwardPass, str]:
    """Filter; return every step up to the end or the first sign of divergence, and the reason for that."""
    x, P, predicted = _begin(timeline, model)
    n, s = len(timeline.dt_s), len(x)
    kept = ForwardPass(np.empty((n, s)), np.empty((n, s, s)), np.empty((n, s)), np.empty((n, s, s)), [np.eye(s)] * n)
    for k, (dt, sample) in enumerate(zip(timeline.dt_s.tolist(), timeline.sample.tolist(), strict=True)):
        if dt > 0:
            x, P, kept.F[k] = predicted(x, P, dt, timeline.accel_enu_mps2[sample])
        kept.x_prior[k], kept.P_prior[k] = x, P
        row = int(timeline.update[k])
        if row >= 0:
            x, P, kept.P_prior[k] = update(row, x, P)
            if not is_healthy(x, P):
                return kept.until(k), f"the covariance is no longer positive definite at {timeline.t_s[k]:.2f} s"
        kept.x[k], kept.P[k] = x, P
    return kept, ""
