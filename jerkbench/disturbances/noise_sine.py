"""Measurement noise whose sigma follows a sine; the errors themselves stay white."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances.common import with_scaled_noise
from jerkbench.errors import PluginError
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("disturbance", "noise_sine")
@dataclass(frozen=True)
class NoiseSine:
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

    def replicates(self) -> int:
        """Return 1."""
        return 1

    def _factor(self, t_s: FloatArray, random: np.random.Generator) -> FloatArray:
        return np.asarray(1.0 + 0.5 * (self.largest - 1.0) * (1.0 - np.cos(2.0 * np.pi * t_s / self.period_s)))
