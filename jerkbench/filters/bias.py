"""The control experiment of the jerk filter: an acceleration bias in ENU."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from jerkbench.arrays import FloatArray, require_not_negative
from jerkbench.filters.common import ACCEL, BIAS_WALK, FIELD, START, AxisModels, Models, identities, outer
from jerkbench.parameters import Provenance
from jerkbench.plugins import register


@register("filter", "bias")
@dataclass(frozen=True)
class Bias(AxisModels):
    """Nine states [p, v, b]: the baseline with an ENU acceleration bias that is a random walk.

    For each axis, with b = [dt^2/2, dt, 0]::

        x = [[1, dt, dt^2/2], [0, 1, dt], [0, 0, 1]] x + b u
        Q = sigma_a^2 (dt0/dt) b b' + diag(0, 0, sigma_b^2 dt)

    The control of the filter `jerk`, whose third state acts as a bias j dt/2: sigma_b = sigma_j dt/2 gives the same
    filter. Where the two agree, it is the bias, not the jerk, that helps.

    Source: the augmented-state treatment of a constant input error (B. Friedland, 1969, doi:10.1109/TAC.1969.1099223).

    Attributes:
        accel_mps2: sigma_a, noise of one sample of u [m/s2].
        bias_mps2_per_sqrt_s: sigma_b, random walk of the bias [m/s2/sqrt(s)].
        initial_bias_mps2: one sigma of the bias at the start [m/s2].
    """

    provenance = Provenance(
        "simplified", "doi:10.1109/TAC.1969.1099223", "The bias walks, and is a state like the others."
    )

    accel_mps2: Annotated[float, ACCEL, FIELD] = 0.1
    bias_mps2_per_sqrt_s: Annotated[float, BIAS_WALK, FIELD] = 0.03
    initial_bias_mps2: Annotated[float, START] = 0.1

    def __post_init__(self) -> None:
        """Check that every noise is a number, and not negative."""
        require_not_negative("filter bias", self, ("accel_mps2", "bias_mps2_per_sqrt_s", "initial_bias_mps2"))

    def axis_models(self, dt: FloatArray, dt0: float) -> Models:
        """Return A (k, 3, 3), b (k, 3), Q (k, 3, 3) for steps of ``dt`` (k,) seconds."""
        A = identities(dt, 3)
        A[:, 0, 1], A[:, 0, 2], A[:, 1, 2] = dt, 0.5 * dt**2, dt
        b = np.stack([0.5 * dt**2, dt, np.zeros_like(dt)], axis=1)
        Q = outer(self.accel_mps2**2 * (dt0 / dt), b)
        Q[:, 2, 2] += self.bias_mps2_per_sqrt_s**2 * dt
        return A, b, Q

    def initial_variances(self) -> FloatArray:
        """Return (1,) the initial variance of the bias."""
        return np.array([self.initial_bias_mps2**2])
