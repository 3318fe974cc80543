"""Measurement noise that is not what the covariance says: larger, heavy-tailed, correlated, or stated otherwise."""

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances.common import (
    CORRELATION_TIME,
    FROM_0_TO_1,
    DrawnFault,
    FixesOrVelocity,
    Once,
    own_stream,
    with_errors,
)
from jerkbench.errors import RecordingError
from jerkbench.parameters import Limit
from jerkbench.plugins import register
from jerkbench.recording import Position, Recording, Velocity
from jerkbench.simulation.imu import gauss_markov

FINITE = Limit(lambda times: np.isfinite(times).all(), "give finite times, in seconds.")
ADDED = Limit(lambda k: 1 <= k < np.inf, "noise can only be added: give 1 or more.")
BELOW_1 = Limit(lambda share: 0 <= share < 1, "a share must be from 0 to below 1.")
_STATED = Limit(lambda k: 0 < k < np.inf, "a standard deviation must stay positive.")


def require_measured(recording: Recording, consequence: str) -> None:
    """Raise a RecordingError, which ``consequence`` ends, where a recording has neither position nor velocity."""
    if recording.position is None and recording.velocity is None:
        raise RecordingError(f"{recording.name} has neither position nor velocity, {consequence}")


def roots_of(measured: Position | Velocity) -> FloatArray:
    """Return L (m, 3, 3), L L' = R as reported; an axis that was not measured has an error that is not used."""
    present = np.isfinite(measured.values)
    return np.linalg.cholesky(np.where(present[:, :, None] & present[:, None, :], measured.reported, np.eye(3)))


class ScaledNoise(DrawnFault):
    """Noise that multiplies the standard deviations of position and velocity by a factor k(t), at least 1.

    Noise of covariance (k^2 - 1) R is added; noise that has the covariance R already then has k^2 R.

    Attributes:
        stream_name: name of the random stream.
        stream: label of the random stream.
    """

    stream_name: ClassVar[str]
    stream: str

    @abstractmethod
    def factor_at(self, t_s: FloatArray, random: np.random.Generator) -> FloatArray:
        """Return k (m,) at the times (m,)."""

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the noise of ``seed``.

        Raises:
            RecordingError: it has neither position nor velocity.
        """
        require_measured(recording, f"so {self.stream_name} finds no noise to raise; leave it out.")
        position, velocity = recording.position, recording.velocity
        return replace(
            recording,
            position=position and self._scaled(position, own_stream(seed, self.stream_name, self.stream, "position")),
            velocity=velocity and self._scaled(velocity, own_stream(seed, self.stream_name, self.stream, "velocity")),
        )

    def _scaled(self, measured: FixesOrVelocity, random: np.random.Generator) -> FixesOrVelocity:
        excess = self.factor_at(measured.t_s, random) ** 2 - 1.0
        unit = np.einsum("mij,mj->mi", roots_of(measured), random.standard_normal((len(excess), 3)))
        return with_errors(measured, np.sqrt(excess)[:, None] * unit, excess[:, None, None] * measured.reported)


@register("disturbance", "noise_step")
@dataclass(frozen=True)
class NoiseStep(ScaledNoise):
    """Noise of position and velocity that doubles at each of the given times; the covariance does not say so.

    With n(t) the number of times up to t, the standard deviation of the noise is k(t) = factor^n(t) times the reported
    one: noise of covariance (k^2 - 1) R is added, on a real recording too, and R_true' = R_true + (k^2 - 1) R.
    A standard test of adaptive filters: how quickly, and how closely, does the adapted R follow?

    Attributes:
        times_s: when a step is.
        factor: on the standard deviation, at each step; 1 or more.
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    stream_name: ClassVar[str] = "noise_step"

    times_s: Annotated[tuple[float, ...], FINITE] = (50.0, 100.0)
    factor: Annotated[float, ADDED] = 2.0
    stream: str = ""

    def factor_at(self, t_s: FloatArray, random: np.random.Generator) -> FloatArray:
        """Return k (m,) at the times (m,)."""
        steps = np.searchsorted(np.sort(self.times_s), t_s, side="right")
        return np.asarray(self.factor**steps)


@register("disturbance", "noise_sine")
@dataclass(frozen=True)
class NoiseSine(ScaledNoise):
    """Noise of position and velocity whose standard deviation follows a sine; the covariance does not say so.

    The standard deviation is k(t) times the reported one, between 1 and the largest factor::

        k(t) = 1 + (largest - 1) (1 - cos(2 pi t/period))/2

    Noise of covariance (k^2 - 1) R is added, on a real recording too, and R_true' = R_true + (k^2 - 1) R. A standard
    test of adaptive filters: a long window is late, a short one restless.

    Attributes:
        largest: factor on the standard deviation at the crest; 1 or more.
        period_s: from one crest to the next.
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    stream_name: ClassVar[str] = "noise_sine"

    largest: Annotated[float, ADDED] = 5.0
    period_s: Annotated[float, Limit(lambda time: 0 < time < np.inf, "give a positive number.")] = 60.0
    stream: str = ""

    def factor_at(self, t_s: FloatArray, random: np.random.Generator) -> FloatArray:
        """Return k (m,) at the times (m,)."""
        return np.asarray(1.0 + 0.5 * (self.largest - 1.0) * (1.0 - np.cos(2.0 * np.pi * t_s / self.period_s)))


@register("disturbance", "heavy_tailed")
@dataclass(frozen=True)
class HeavyTailed(ScaledNoise):
    """Heavy-tailed noise of position and velocity: a tenth of it has ten sigma; the covariance does not say so.

    Tukey's contaminated normal, at the level of what is reported::

        noise ~ (1 - p) N(0, R) + p N(0, k^2 R)

    Noise of covariance (k^2 - 1) R is added to the measurements that are drawn (positions and velocities
    independently), so that it works on a real recording too. R_true' = R_true + (k^2 - 1) R of those.

    Source: J. W. Tukey, "A survey of sampling from contaminated distributions", in I. Olkin et al. (eds.),
    Contributions to Probability and Statistics, Stanford University Press, 1960.

    Attributes:
        probability: p, from 0 to 1.
        factor: k, 1 or more.
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    stream_name: ClassVar[str] = "heavy_tailed"

    probability: Annotated[float, FROM_0_TO_1] = 0.1
    factor: Annotated[float, ADDED] = 10.0
    stream: str = ""

    def factor_at(self, t_s: FloatArray, random: np.random.Generator) -> FloatArray:
        """Return k (m,) at the times (m,)."""
        return np.where(random.uniform(size=len(t_s)) < self.probability, self.factor, 1.0)


@register("disturbance", "coloured")
@dataclass(frozen=True)
class Coloured(DrawnFault):
    """A slow error on top of the noise of position and velocity: a share of the variance then lasts.

    With R as reported and L L' = R, a Gauss-Markov process b(t) of unit variance and f = s/(1 - s)::

        z' = z + sqrt(f) L b(t),  E[b(t) b(t + tau)'] = I exp(-|tau|/T)
        R_true' = R_true + f R,   R' = R + f R where it is reported

    Where the noise of z was white with R, a share s of the new variance R/(1 - s) lasts. Even when it is reported, a
    filter that takes errors for new each time becomes too sure of itself.

    Attributes:
        position_share: s of position, from 0 to below 1.
        position_time_s: T of position.
        velocity_share: s of velocity; 0: it stays as it is.
        velocity_time_s: T of velocity.
        reported: whether the reported covariance grows as well.
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    position_share: Annotated[float, BELOW_1] = 0.8
    position_time_s: Annotated[float, CORRELATION_TIME] = 10.0
    velocity_share: Annotated[float, BELOW_1] = 0.0
    velocity_time_s: Annotated[float, CORRELATION_TIME] = 2.0
    reported: bool = True
    stream: str = ""

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the slow errors of ``seed``.

        Raises:
            RecordingError: it has neither position nor velocity.
        """
        require_measured(recording, "so no error can last; leave it out.")
        return replace(
            recording,
            position=self._slow(recording.position, "position", seed),
            velocity=self._slow(recording.velocity, "velocity", seed),
        )

    def _slow(self, measured: FixesOrVelocity | None, part: str, seed: int) -> FixesOrVelocity | None:
        share, time_s = getattr(self, f"{part}_share"), getattr(self, f"{part}_time_s")
        if measured is None or not share or not len(measured.t_s):
            return measured
        process = gauss_markov(measured.t_s, time_s, own_stream(seed, "coloured", self.stream, part))
        f, R = share / (1.0 - share), measured.reported
        errors = np.sqrt(f) * np.einsum("mij,mj->mi", roots_of(measured), process)
        return with_errors(measured, errors, f * R, reported_growth=f * R if self.reported else 0.0)


@register("disturbance", "stated_covariance")
@dataclass(frozen=True)
class StatedCovariance(Once):
    """Only what is reported changes: standard deviations of position and velocity are stated k times as large.

    R' = k^2 R, values and R_true as they were (where nothing better is known, R_true is the R reported before).
    k below 1 is a receiver that boasts, above 1 one that is modest.

    Attributes:
        position_factor: k of position.
        velocity_factor: k of velocity.
    """

    position_factor: Annotated[float, _STATED] = 0.2
    velocity_factor: Annotated[float, _STATED] = 1.0

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with other reported covariances.

        Raises:
            RecordingError: it has neither position nor velocity.
        """
        require_measured(recording, "of which something could be stated.")
        position = _stated(recording.position, self.position_factor)
        return replace(recording, position=position, velocity=_stated(recording.velocity, self.velocity_factor))


def _stated(measured: FixesOrVelocity | None, factor: float) -> FixesOrVelocity | None:
    return measured and measured.changed(measured.values, factor**2 * measured.reported, measured.true)
