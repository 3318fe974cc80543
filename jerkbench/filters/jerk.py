"""The jerk-augmented filter of the paper."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from jerkbench.arrays import FloatArray, require_not_negative
from jerkbench.filters.common import ACCEL, FIELD, JERK_WALK, START, AxisModels, Models, identities, outer
from jerkbench.parameters import Provenance
from jerkbench.plugins import register


@register("filter", "jerk")
@dataclass(frozen=True)
class Jerk(AxisModels):
    """Nine states [p, v, j]: the baseline with a jerk that is a random walk.

    For each axis, with b = [dt^2/2, dt, 0]::

        x = [[1, dt, dt^3/6], [0, 1, dt^2/2], [0, 0, 1]] x + b u
        Q = sigma_a^2 (dt0/dt) b b' + diag(0, 0, sigma_j^2 dt)

    No state carries an acceleration, so the jerk never integrates into one: over a step it adds j dt^2/2 to the
    velocity, just as an acceleration bias of j dt/2 would. The filter `bias` says so openly and is its control.

    Source: the jerk-augmented extended Kalman filter of Candan, Atallah, Servadio and Arabi, "Resilient Navigation for
    Autonomous Farm Robots by Leveraging Jerk-Augmented Models with IMU-Only Disturbance Rejection".

    Attributes:
        accel_mps2: sigma_a, noise of one sample of u [m/s2].
        jerk_mps3_per_sqrt_s: sigma_j, random walk of the jerk [m/s3/sqrt(s)].
        initial_jerk_mps3: one sigma of the jerk at the start [m/s3].
    """

    provenance = Provenance("published", "Candan, Atallah, Servadio and Arabi")

    accel_mps2: Annotated[float, ACCEL, FIELD] = 0.1
    jerk_mps3_per_sqrt_s: Annotated[float, JERK_WALK, FIELD] = 6.0
    initial_jerk_mps3: Annotated[float, START] = 20.0

    def __post_init__(self) -> None:
        """Check that every noise is a number, and not negative."""
        require_not_negative("filter jerk", self, ("accel_mps2", "jerk_mps3_per_sqrt_s", "initial_jerk_mps3"))

    def axis_models(self, dt: FloatArray, dt0: float) -> Models:
        """Return A (k, 3, 3), b (k, 3), Q (k, 3, 3) for steps of ``dt`` (k,) seconds."""
        A = identities(dt, 3)
        A[:, 0, 1], A[:, 0, 2], A[:, 1, 2] = dt, dt**3 / 6.0, 0.5 * dt**2
        b = np.stack([0.5 * dt**2, dt, np.zeros_like(dt)], axis=1)
        Q = outer(self.accel_mps2**2 * (dt0 / dt), b)
        Q[:, 2, 2] += self.jerk_mps3_per_sqrt_s**2 * dt
        return A, b, Q

    def initial_variances(self) -> FloatArray:
        """Return (1,) the initial variance of the jerk."""
        return np.array([self.initial_jerk_mps3**2])
