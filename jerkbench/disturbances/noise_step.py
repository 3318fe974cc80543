"""Measurement noise that grows, at once or as a sine."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances.common import Once, with_scaled_noise
from jerkbench.errors import PluginError
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("disturbance", "noise_step")
@dataclass(frozen=True)
class NoiseStep(Once):
    """Noise of position and velocity that doubles at each of the given times; the covariance does not say so.

    With n(t) the number of times up to t, the standard deviation of the noise is k(t) = factor^n(t) times the reported
    one: noise of covariance (k^2 - 1) R is added, on a real recording too, and R_true' = R_true + (k^2 - 1) R.
    A standard test of adaptive filters: how quickly, and how closely, does the adapted R follow?

    Attributes:
        times_s: when a step is.
        factor: on the standard deviation, at each step; 1 or more.
        stream: label of the random stream; give a second disturbance of this name in a list another one.
    """

    seeded: ClassVar[bool] = True

    times_s: tuple[float, ...] = (50.0, 100.0)
    factor: float = 2.0
    stream: str = ""

    def __post_init__(self) -> None:
        """Check times and factor."""
        if not np.isfinite(self.times_s).all():
            raise PluginError(f"times_s is {self.times_s}; give finite times, in seconds.")
        if not 1 <= self.factor < np.inf:
            raise PluginError(f"factor is {self.factor}; noise can only be added: give 1 or more.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the noise of ``seed``.

        Raises:
            RecordingError: it has neither position nor velocity.
        """
        return with_scaled_noise(recording, seed, "noise_step", self.stream, self._factor)

    def _factor(self, t_s: FloatArray, random: np.random.Generator) -> FloatArray:
        steps = np.searchsorted(np.sort(self.times_s), t_s, side="right")
        return np.asarray(self.factor**steps)


# Measurement noise whose sigma follows a sine; the errors themselves stay white.


@register("disturbance", "noise_sine")
@dataclass(frozen=True)
class NoiseSine(Once):
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

    seeded: ClassVar[bool] = True

    largest: float = 5.0
    period_s: float = 60.0
    stream: str = ""

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 1 <= self.largest < np.inf:
            raise PluginError(f"largest is {self.largest}; noise can only be added: give 1 or more.")
        if not 0 < self.period_s < np.inf:
            raise PluginError(f"period_s is {self.period_s}; give a positive number.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the noise of ``seed``.

        Raises:
            RecordingError: it has neither position nor velocity.
        """
        return with_scaled_noise(recording, seed, "noise_sine", self.stream, self._factor)

    def _factor(self, t_s: FloatArray, random: np.random.Generator) -> FloatArray:
        return np.asarray(1.0 + 0.5 * (self.largest - 1.0) * (1.0 - np.cos(2.0 * np.pi * t_s / self.period_s)))
