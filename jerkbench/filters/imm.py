"""Interacting multiple models: two kinematic filters that share one state."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.batch import RecordedRun, Streamed
from jerkbench.checks import require_not_negative
from jerkbench.contracts import Adaptation, Filter
from jerkbench.errors import PluginError, unknown
from jerkbench.estimate import Attitude, Estimate
from jerkbench.filters._accepted import without_fading
from jerkbench.filters._mixture import Mixture, embedded
from jerkbench.filters.acceleration import Acceleration
from jerkbench.filters.baseline import Baseline
from jerkbench.filters.bias import Bias
from jerkbench.filters.jerk import Jerk
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.timeline.timeline import Timeline, build_timeline

if TYPE_CHECKING:
    from jerkbench.linear.solution import Mixed  # what it imports takes half a second

MODELS = ("acceleration", "baseline", "bias", "jerk")
NOISES = (
    *("first_accel_mps2", "second_accel_mps2", "jerk_mps3_per_sqrt_s", "initial_jerk_mps3"),
    *("bias_mps2_per_sqrt_s", "initial_bias_mps2"),
    *("first_walk_mps2_per_sqrt_s", "second_walk_mps2_per_sqrt_s", "initial_accel_mps2"),
)


@register("filter", "imm")
@dataclass(frozen=True)
class InteractingMultipleModels:
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
    every adaptation that does not fade P.

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

    first: str = "baseline"
    second: str = "jerk"
    first_stays: float = 0.95
    second_stays: float = 0.95
    first_probability: float = 0.5
    first_accel_mps2: float = 0.2
    second_accel_mps2: float = 0.1
    jerk_mps3_per_sqrt_s: float = 6.0
    initial_jerk_mps3: float = 20.0
    bias_mps2_per_sqrt_s: float = 0.03
    initial_bias_mps2: float = 0.1
    first_walk_mps2_per_sqrt_s: float = 2.0
    second_walk_mps2_per_sqrt_s: float = 0.2
    initial_accel_mps2: float = 1.0

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
        """Names of the adaptations that it accepts: all that do not fade P."""
        return without_fading()

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

    def estimate_compiled(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate | None:
        """Return the same as `estimate`; None where numba cannot compile the adaptation."""
        from jerkbench.linear.solution import mix_compiled

        timeline = build_timeline(recording, attitude)
        return mix_compiled(timeline, self._start(timeline, adaptation), adaptation)

    def run_many(
        self, runs: Sequence[RecordedRun], adaptation: Adaptation, *, updates: bool, attitude: bool, threads: int
    ) -> Sequence[Streamed | None]:
        """Return the sums of each run, as in `jerkbench.contracts.Batched`; it finds no attitude of its own."""
        from jerkbench.estimation.threads import side_by_side
        from jerkbench.linear.solution import stream_mixture

        def sums(run: RecordedRun) -> Streamed | None:
            """Return those of one run."""
            start = self._start(run.timeline, adaptation)
            return stream_mixture(run.timeline, run.scoring, start, adaptation, updates=updates)

        return side_by_side(sums, runs, threads)

    def _mixture(self, timeline: Timeline, adaptation: Adaptation) -> Mixture:
        mu = np.array([self.first_probability, 1.0 - self.first_probability])
        return Mixture(timeline, self.models(), self.transitions(), mu, adaptation)

    def _start(self, timeline: Timeline, adaptation: Adaptation) -> "Mixed":
        from jerkbench.linear.solution import Mixed

        mixture = self._mixture(timeline, adaptation)
        return Mixed(self.models(), mixture.transitions, mixture.weights, mixture.x, mixture.P)

    def _model(self, name: str, accel_mps2: float, walk_mps2_per_sqrt_s: float) -> Filter:
        if name == "baseline":
            return Baseline(accel_mps2)
        if name == "acceleration":
            return Acceleration(walk_mps2_per_sqrt_s, self.initial_accel_mps2)
        if name == "jerk":
            return Jerk(accel_mps2, self.jerk_mps3_per_sqrt_s, self.initial_jerk_mps3)
        return Bias(accel_mps2, self.bias_mps2_per_sqrt_s, self.initial_bias_mps2)
