"""The Rauch-Tung-Striebel smoother over a kinematic filter: it sees the future, as a yardstick."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, require_not_negative
from jerkbench.contracts import Adaptation, Filter
from jerkbench.errors import PluginError, unknown
from jerkbench.estimate import Attitude, Estimate
from jerkbench.filters.baseline import Baseline
from jerkbench.filters.bias import Bias
from jerkbench.filters.common import (
    ACCEL,
    BIAS_WALK,
    JERK_WALK,
    CompiledWays,
    MeasurementUpdates,
    OverTimelines,
    StepModels,
    initial,
    of_r_or_fading,
)
from jerkbench.filters.jerk import Jerk
from jerkbench.kalman import is_healthy
from jerkbench.parameters import DefaultOrigin, Provenance
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.timeline import Recorder, Timeline, build_timeline

MODELS = ("baseline", "bias", "jerk")
NOISES = (
    *("accel_mps2", "jerk_mps3_per_sqrt_s", "initial_jerk_mps3"),
    *("bias_mps2_per_sqrt_s", "initial_bias_mps2"),
)


@register("filter", "rts")
@dataclass(frozen=True)
class RauchTungStriebel(OverTimelines):
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
    states, 2.9 kB with nine. The engine `compiled` runs the same by adjoints (`jerkbench.linear.smoother`), which take
    no inverse of P-, and agrees to 1e-9 m, and to 1e-12 of sqrt(P_ii P_jj) or what the inverse of P- makes of changes
    in the last bits of the input. In a gap both subtract nearly equal covariances, and have errors of 1e-12
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
    accel_mps2: Annotated[float, ACCEL, DefaultOrigin("that of the filter by itself")] = 0.1
    jerk_mps3_per_sqrt_s: Annotated[float, JERK_WALK, DefaultOrigin("that of the filter by itself")] = 6.0
    initial_jerk_mps3: Annotated[float, DefaultOrigin("that of the filter by itself")] = 20.0
    bias_mps2_per_sqrt_s: Annotated[float, BIAS_WALK, DefaultOrigin("that of the filter by itself")] = 0.03
    initial_bias_mps2: Annotated[float, DefaultOrigin("that of the filter by itself")] = 0.1

    def __post_init__(self) -> None:
        """Check the name of the model and the noises, those of the other models too."""
        if self.model not in MODELS:
            raise PluginError(unknown("model of filter rts", self.model, MODELS))
        require_not_negative("filter rts", self, NOISES)

    @property
    def adaptations(self) -> tuple[str, ...]:
        """Names of the adaptations that it accepts: all that change R, or fade P-."""
        return of_r_or_fading()

    def kinematic_filter(self) -> Filter:
        """Return the filter of the forward pass."""
        if self.model == "baseline":
            return Baseline(self.accel_mps2)
        if self.model == "jerk":
            return Jerk(self.accel_mps2, self.jerk_mps3_per_sqrt_s, self.initial_jerk_mps3)
        return Bias(self.accel_mps2, self.bias_mps2_per_sqrt_s, self.initial_bias_mps2)

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the smoothed solution at the reference's stamps; where the forward pass stops, up to there."""
        return self.smooth(build_timeline(recording, attitude), adaptation)

    def compiled_ways(self) -> CompiledWays:
        """Return what smooths one timeline, and what smooths several side by side."""
        from jerkbench.linear.smoother import smooth_many, smooth_one

        return smooth_one, smooth_many

    def start(self, timeline: Timeline) -> Filter:
        """Return the filter of the forward pass, which begins as the timeline says."""
        return self.kinematic_filter()

    def smooth(self, timeline: Timeline, adaptation: Adaptation) -> Estimate:
        """Return the smoothed solution of a timeline."""
        recorder = Recorder(timeline)
        forward, failure = _forward(timeline, self.kinematic_filter(), adaptation, recorder)
        x, P = smoothed(forward)
        for k in np.flatnonzero(timeline.reference[: len(x)] >= 0).tolist():
            recorder.state(int(timeline.reference[k]), x[k, :6], P[k, :6, :6])
        return recorder.estimate(failure)


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


def _forward(timeline: Timeline, model: Filter, adaptation: Adaptation, recorder: Recorder) -> tuple[ForwardPass, str]:
    """Filter; return every step up to the end or the first sign of divergence, and the reason for that."""
    x, P = initial(timeline, model)
    n, s = len(timeline.dt_s), len(x)
    kept = ForwardPass(np.empty((n, s)), np.empty((n, s, s)), np.empty((n, s)), np.empty((n, s, s)), [np.eye(s)] * n)
    models = StepModels(model, timeline.dt0_s)
    update = MeasurementUpdates(timeline, adaptation, recorder)
    for k, (dt, sample) in enumerate(zip(timeline.dt_s.tolist(), timeline.sample.tolist(), strict=True)):
        if dt > 0:
            F, B, Q = models.of(dt)
            x, P = F @ x + B @ timeline.accel_enu_mps2[sample], F @ P @ F.T + Q
            kept.F[k] = F
        kept.x_prior[k], kept.P_prior[k] = x, P
        row = int(timeline.update[k])
        if row >= 0:
            x, P, kept.P_prior[k] = update(row, x, P)
            if not is_healthy(x, P):
                return kept.until(k), f"the covariance is no longer positive definite at {timeline.t_s[k]:.2f} s"
        kept.x[k], kept.P[k] = x, P
    return kept, ""
