"""Contaminated measurement noise."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.disturbances.common import Once, with_scaled_noise
from jerkbench.errors import PluginError
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("disturbance", "heavy_tailed")
@dataclass(frozen=True)
class HeavyTailed(Once):
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

    seeded: ClassVar[bool] = True

    probability: float = 0.1
    factor: float = 10.0
    stream: str = ""

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0 <= self.probability <= 1:
            raise PluginError(f"probability is {self.probability}; it must be from 0 to 1.")
        if not 1 <= self.factor < np.inf:
            raise PluginError(f"factor is {self.factor}; noise can only be added: give 1 or more.")

    def apply(self, recording: Recording, seed: int) -> Recording:
        """Return the recording with the contamination of ``seed``.

        Raises:
            RecordingError: it has neither position nor velocity.
        """
        return with_scaled_noise(recording, seed, "heavy_tailed", self.stream, self._factor)

    def _factor(self, t_s: FloatArray, random: np.random.Generator) -> FloatArray:
        return np.where(random.uniform(size=len(t_s)) < self.probability, self.factor, 1.0)
