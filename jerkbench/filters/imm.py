"""Interacting multiple models: two kinematic filters that share one state."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from jerkbench.arrays import FloatArray, require_not_negative
from jerkbench.contracts import Adaptation, Filter
from jerkbench.errors import PluginError, unknown
from jerkbench.estimate import Attitude, Estimate
from jerkbench.filters._mixture import Mixture, embedded, mixed_start
from jerkbench.filters.acceleration import Acceleration
from jerkbench.filters.baseline import Baseline
from jerkbench.filters.bias import Bias
from jerkbench.filters.common import (
    ACCEL,
    ACCEL_WALK,
    BIAS_WALK,
    JERK_WALK,
    STAYS,
    CompiledWays,
    OverTimelines,
    of_r_alone,
)
from jerkbench.filters.jerk import Jerk
from jerkbench.parameters import DefaultOrigin, Provenance
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.timeline import Timeline, build_timeline

if TYPE_CHECKING:
    from jerkbench.linear.mixture import Mixed  # what it imports takes half a second

MODELS = ("acceleration", "baseline", "bias", "jerk")
NOISES = (
    *("first_accel_mps2", "second_accel_mps2", "jerk_mps3_per_sqrt_s", "initial_jerk_mps3"),
    *("bias_mps2_per_sqrt_s", "initial_bias_mps2"),
    *("first_walk_mps2_per_sqrt_s", "second_walk_mps2_per_sqrt_s", "initial_accel_mps2"),
)


@register("filter", "imm")
@dataclass(frozen=True)
class InteractingMultipleModels(OverTimelines):
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
    first_stays: Annotated[float, STAYS, DefaultOrigin("ours: a model lasts 20 updates")] = 0.95
    second_stays: Annotated[float, STAYS, DefaultOrigin("ours: a model lasts 20 updates")] = 0.95
    first_probability: Annotated[float, DefaultOrigin("ours: neither model is preferred")] = 0.5
    first_accel_mps2: Annotated[float, ACCEL, DefaultOrigin("that of the filter by itself")] = 0.2
    second_accel_mps2: Annotated[float, ACCEL, DefaultOrigin("that of the filter by itself")] = 0.1
    jerk_mps3_per_sqrt_s: Annotated[float, JERK_WALK, DefaultOrigin("that of the filter by itself")] = 6.0
    initial_jerk_mps3: Annotated[float, DefaultOrigin("that of the filter by itself")] = 20.0
    bias_mps2_per_sqrt_s: Annotated[float, BIAS_WALK, DefaultOrigin("that of the filter by itself")] = 0.03
    initial_bias_mps2: Annotated[float, DefaultOrigin("that of the filter by itself")] = 0.1
    first_walk_mps2_per_sqrt_s: Annotated[float, ACCEL_WALK, DefaultOrigin("that of the filter by itself")] = 2.0
    second_walk_mps2_per_sqrt_s: Annotated[
        float, ACCEL_WALK, DefaultOrigin("ours: a tenth of the first, for calm driving")
    ] = 0.2
    initial_accel_mps2: Annotated[float, DefaultOrigin("that of the filter by itself")] = 1.0

    def __post_init__(self) -> None:
        """Check the pair of models, the noises and the probabilities."""
        for name in (self.first, self.second):
            if name not in MODELS:
                raise PluginError(unknown("model of filter imm", name, MODELS))
        if len({self.first, self.second} - {"baseline"}) > 1:
            raise PluginError(
                f"imm cannot mix {self.first} with {self.second}, whose third states mean different things; pair either"
                " of them with baseline, or with itself."
            )
        require_not_negative("filter imm", self, NOISES)
        for name in ("first_stays", "second_stays", "first_probability"):
            if not 0 < getattr(self, name) < 1:
                raise PluginError(f"imm.{name} is {getattr(self, name)}; it must lie between 0 and 1.")

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
        from jerkbench.linear.mixture import mix_alone, mix_many

        return mix_alone, mix_many

    def _mixture(self, timeline: Timeline, adaptation: Adaptation) -> Mixture:
        return Mixture(timeline, self.models(), self.transitions(), self._probabilities(), adaptation)

    def _probabilities(self) -> FloatArray:
        return np.array([self.first_probability, 1.0 - self.first_probability])

    def start(self, timeline: Timeline) -> "Mixed":
        """Return the filters with their mixed states at the start of a timeline."""
        from jerkbench.linear.mixture import Mixed

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
