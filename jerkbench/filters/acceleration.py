"""A filter that takes no input: the acceleration is a state."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import FloatArray, require_not_negative
from jerkbench.filters.common import ACCEL_WALK, START, WALK, AxisModels, Models, identities, outer
from jerkbench.parameters import Provenance
from jerkbench.plugins import register


@register("filter", "acceleration")
@dataclass(frozen=True)
class Acceleration(AxisModels):
    """Nine states [p, v, a]: the acceleration is a random walk, and the IMU is not used.

    For each axis, with q = [dt^2/2, dt, 1] and no input (b = 0)::

        x = [[1, dt, dt^2/2], [0, 1, dt], [0, 0, 1]] x
        Q = sigma_w^2 dt q q'

    It owes nothing to attitude or accelerometer, so that neither can mislead it, and it knows nothing between fixes
    and in an outage but the last acceleration. What the baseline gains over it is what the IMU is worth.

    Source: the Wiener-process acceleration model (Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to
    Tracking and Navigation", 6.3, doi:10.1002/0471221279), the "9-state" filter of the paper's related work.

    Attributes:
        accel_walk_mps2_per_sqrt_s: sigma_w, random walk of the acceleration [m/s2/sqrt(s)].
        initial_accel_mps2: one sigma of the acceleration at the start [m/s2].
    """

    provenance = Provenance("published", "doi:10.1002/0471221279")

    uses_imu: ClassVar[bool] = False

    accel_walk_mps2_per_sqrt_s: Annotated[float, ACCEL_WALK, WALK] = 2.0
    initial_accel_mps2: Annotated[float, START] = 1.0

    def __post_init__(self) -> None:
        """Check that every noise is a number, and not negative."""
        require_not_negative("filter acceleration", self, ("accel_walk_mps2_per_sqrt_s", "initial_accel_mps2"))

    def axis_models(self, dt: FloatArray, dt0: float) -> Models:
        """Return A (k, 3, 3), b (k, 3), Q (k, 3, 3) for steps of ``dt`` (k,) seconds."""
        A = identities(dt, 3)
        A[:, 0, 1], A[:, 0, 2], A[:, 1, 2] = dt, 0.5 * dt**2, dt
        q = np.stack([0.5 * dt**2, dt, np.ones_like(dt)], axis=1)
        return A, np.zeros_like(q), outer(self.accel_walk_mps2_per_sqrt_s**2 * dt, q)

    def initial_variances(self) -> FloatArray:
        """Return (1,) the initial variance of the acceleration."""
        return np.array([self.initial_accel_mps2**2])
