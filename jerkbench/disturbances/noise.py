"""Measurement noise that differs from the reported covariance: larger, heavy-tailed, or correlated."""

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances.common import (
    FROM_0_TO_1,
    DrawnFault,
    FixesOrVelocity,
    Unphased,
    fault_stream,
    with_errors,
)
from jerkbench.errors import RecordingError
from jerkbench.parameters import ABOVE_ZERO, Limit
from jerkbench.plugins import register
from jerkbench.recording import Position, Recording, Velocity
from jerkbench.simulation.sensors import gauss_markov

FINITE = Limit(lambda times: np.isfinite(times).all(), "give finite times, in seconds.")
ADDED = Limit(lambda k: 1 <= k < np.inf, "it must be at least 1, because noise can only be added.")
BELOW_1 = Limit(lambda share: 0 <= share < 1, "it must be from 0 to below 1.")


def require_measured(recording: Recording, consequence: str) -> None:
    """Check that a recording has position fixes or velocities.

    Raises:
        RecordingError: the recording has neither position nor velocity; the message ends with ``consequence``.
    """
    if recording.position is None and recording.velocity is None:
        raise RecordingError(f"{recording.name} has neither position nor velocity, {consequence}")


def roots_of(measured: Position | Velocity) -> FloatArray:
    """Return Cholesky factors L (m, 3, 3) of the reported R = L L'. An axis that was not measured has the factor 1."""
    present = np.isfinite(measured.values)
    return np.linalg.cholesky(np.where(present[:, :, None] & present[:, None, :], measured.reported, np.eye(3)))


class ScaledNoise(DrawnFault):
    """Base class of disturbances that multiply the noise of position and velocity by a factor k(t) of at least 1.

    Noise with the covariance (k^2 - 1) R is added to each measurement, where R is the reported covariance. If the
    original noise has the covariance R, the total noise has the covariance k^2 R.

    Attributes:
        stream_name: name of the random stream of the disturbance.
        stream: label of the random stream; disturbances of the same type need different labels to be independent.
    """

    stream_name: ClassVar[str]
    stream: str

    @abstractmethod
    def factor_at(self, t_s: FloatArray, random: np.random.Generator) -> FloatArray:
        """Return the factor k (m,) on the standard deviation at each of the times ``t_s`` (m,)."""

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with additional random noise, generated with ``seed``.

        Raises:
            RecordingError: the recording has neither position nor velocity.
        """
        require_measured(recording, f"so {self.stream_name} cannot be applied; remove {self.stream_name}.")
        position, velocity = recording.position, recording.velocity
        return replace(
            recording,
            position=position and self._scaled(position, fault_stream(seed, self.stream_name, self.stream, "position")),
            velocity=velocity and self._scaled(velocity, fault_stream(seed, self.stream_name, self.stream, "velocity")),
        )

    def _scaled(self, measured: FixesOrVelocity, random: np.random.Generator) -> FixesOrVelocity:
        excess = self.factor_at(measured.t_s, random) ** 2 - 1.0
        unit = np.einsum("mij,mj->mi", roots_of(measured), random.standard_normal((len(excess), 3)))
        return with_errors(measured, np.sqrt(excess)[:, None] * unit, excess[:, None, None] * measured.reported)


@register("disturbance", "noise_step")
@dataclass(frozen=True)
class NoiseStep(ScaledNoise):
    """Increases the noise of position and velocity in steps, without a change of the reported covariance.

    The standard deviation of the noise is multiplied by k(t) = factor^n(t), where n(t) is the number of steps up to the
    time t. To increase the noise of simulated and real recordings, noise with the covariance (k^2 - 1) R is added::

        R_true' = R_true + (k^2 - 1) R,  R' = R

    A step of the noise is a standard test of the speed and the accuracy of adaptive filters.

    Attributes:
        times_s: times of the steps [s].
        factor: factor on the standard deviation at each step, at least 1 [-].
        stream: label of the random stream; disturbances of the same type need different labels to be independent.
    """

    stream_name: ClassVar[str] = "noise_step"

    times_s: Annotated[tuple[float, ...], FINITE] = (50.0, 100.0)
    factor: Annotated[float, ADDED] = 2.0
    stream: str = ""

    def factor_at(self, t_s: FloatArray, random: np.random.Generator) -> FloatArray:
        """Return the factor k (m,) on the standard deviation at each of the times ``t_s`` (m,)."""
        steps = np.searchsorted(np.sort(self.times_s), t_s, side="right")
        return np.asarray(self.factor**steps)


@register("disturbance", "noise_sine")
@dataclass(frozen=True)
class NoiseSine(ScaledNoise):
    """Varies the noise of position and velocity sinusoidally, without a change of the reported covariance.

    The standard deviation of the noise is multiplied by k(t), which varies between 1 and ``largest``::

        k(t) = 1 + (largest - 1) (1 - cos(2 pi t/period))/2
        R_true' = R_true + (k^2 - 1) R,  R' = R

    To increase the noise of simulated and real recordings, noise with the covariance (k^2 - 1) R is added. Sinusoidal
    noise is a standard test of adaptive filters. An estimate of R over a long window is delayed, and an estimate over a
    short window is noisy.

    Attributes:
        largest: maximum factor on the standard deviation, at least 1 [-].
        period_s: period of the sine [s].
        stream: label of the random stream; disturbances of the same type need different labels to be independent.
    """

    stream_name: ClassVar[str] = "noise_sine"

    largest: Annotated[float, ADDED] = 5.0
    period_s: Annotated[float, ABOVE_ZERO] = 60.0
    stream: str = ""

    def factor_at(self, t_s: FloatArray, random: np.random.Generator) -> FloatArray:
        """Return the factor k (m,) on the standard deviation at each of the times ``t_s`` (m,)."""
        return np.asarray(1.0 + 0.5 * (self.largest - 1.0) * (1.0 - np.cos(2.0 * np.pi * t_s / self.period_s)))


@register("disturbance", "heavy_tailed")
@dataclass(frozen=True)
class HeavyTailed(ScaledNoise):
    """Adds heavy-tailed noise to position and velocity, without a change of the reported covariance.

    The noise has Tukey's contaminated normal distribution, with the reported covariance R::

        noise ~ (1 - p) N(0, R) + p N(0, k^2 R)

    Each position and each velocity is contaminated with the probability p, independently of all other measurements.
    Noise with the covariance (k^2 - 1) R is added to the contaminated measurements, also in real recordings. The true
    covariance of a contaminated measurement is R_true' = R_true + (k^2 - 1) R.

    Source: J. W. Tukey, "A survey of sampling from contaminated distributions", in I. Olkin et al. (eds.),
    Contributions to Probability and Statistics, Stanford University Press, 1960.

    Attributes:
        probability: p, probability that a measurement is contaminated, from 0 to 1 [-].
        factor: k, factor on the standard deviation of contaminated measurements, at least 1 [-].
        stream: label of the random stream; disturbances of the same type need different labels to be independent.
    """

    stream_name: ClassVar[str] = "heavy_tailed"

    probability: Annotated[float, FROM_0_TO_1] = 0.1
    factor: Annotated[float, ADDED] = 10.0
    stream: str = ""

    def factor_at(self, t_s: FloatArray, random: np.random.Generator) -> FloatArray:
        """Return the factor k (m,) on the standard deviation at each of the times ``t_s`` (m,)."""
        return np.where(random.uniform(size=len(t_s)) < self.probability, self.factor, 1.0)


@register("disturbance", "coloured")
@dataclass(frozen=True)
class Coloured(DrawnFault):
    """Adds a time-correlated error to position and velocity.

    The added error is a Gauss-Markov process b(t) of unit variance, scaled with the reported covariance R = L L' and
    with the factor f = s/(1 - s)::

        z' = z + sqrt(f) L b(t),  E[b(t) b(t + tau)'] = I exp(-|tau|/T)
        R_true' = R_true + f R,   R' = R + f R if it is reported, else R' = R

    If the original noise of z is white with the covariance R, the fraction s of the new variance R/(1 - s) is
    correlated in time. A filter that models the errors as white is overconfident, even if the reported covariance
    includes the error.

    Attributes:
        position_share: s of the position, the correlated fraction of the variance, from 0 (no change) to below 1 [-].
        position_time_s: T of the position, the correlation time of the added error [s].
        velocity_share: s of the velocity, the correlated fraction of the variance, from 0 (no change) to below 1 [-].
        velocity_time_s: T of the velocity, the correlation time of the added error [s].
        reported: if true, the reported covariance includes the added error.
        stream: label of the random stream; disturbances of the same type need different labels to be independent.
    """

    position_share: Annotated[float, BELOW_1] = 0.8
    position_time_s: Annotated[float, ABOVE_ZERO] = 10.0
    velocity_share: Annotated[float, BELOW_1] = 0.0
    velocity_time_s: Annotated[float, ABOVE_ZERO] = 2.0
    reported: bool = True
    stream: str = ""

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with random time-correlated errors, generated with ``seed``.

        Raises:
            RecordingError: the recording has neither position nor velocity.
        """
        require_measured(recording, "so coloured cannot be applied; remove coloured.")
        return replace(
            recording,
            position=self._slow(recording.position, "position", seed),
            velocity=self._slow(recording.velocity, "velocity", seed),
        )

    def _slow(self, measured: FixesOrVelocity | None, part: str, seed: int) -> FixesOrVelocity | None:
        share, time_s = getattr(self, f"{part}_share"), getattr(self, f"{part}_time_s")
        if measured is None or not share or not len(measured.t_s):
            return measured
        process = gauss_markov(measured.t_s, time_s, fault_stream(seed, "coloured", self.stream, part))
        f, R = share / (1.0 - share), measured.reported
        errors = np.sqrt(f) * np.einsum("mij,mj->mi", roots_of(measured), process)
        return with_errors(measured, errors, f * R, reported_growth=f * R if self.reported else 0.0)


@register("disturbance", "stated_covariance")
@dataclass(frozen=True)
class StatedCovariance(Unphased):
    """Multiplies the reported standard deviations of position and velocity by k, without a change of the values.

    The new reported covariance is R' = k^2 R. The true covariance does not change. If the true covariance is not known,
    the original R becomes the true covariance. The receiver is overconfident if k is below 1, and conservative if k is
    above 1.

    Attributes:
        position_factor: k, factor on the reported standard deviations of the position [-].
        velocity_factor: k, factor on the reported standard deviations of the velocity [-].
    """

    position_factor: Annotated[float, ABOVE_ZERO] = 0.2
    velocity_factor: Annotated[float, ABOVE_ZERO] = 1.0

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with scaled reported covariances. The seed has no effect.

        Raises:
            RecordingError: the recording has neither position nor velocity.
        """
        require_measured(recording, "so stated_covariance cannot be applied; remove stated_covariance.")
        position = _stated(recording.position, self.position_factor)
        return replace(recording, position=position, velocity=_stated(recording.velocity, self.velocity_factor))


def _stated(measured: FixesOrVelocity | None, factor: float) -> FixesOrVelocity | None:
    return measured and measured.changed(measured.values, factor**2 * measured.reported, measured.true)
