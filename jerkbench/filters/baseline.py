"""The baseline: position and velocity, driven by the measured acceleration."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from jerkbench.arrays import FloatArray, require_not_negative
from jerkbench.filters.common import ACCEL, AxisModels, Models, identities, outer
from jerkbench.parameters import DefaultOrigin, Provenance
from jerkbench.plugins import register


@register("filter", "baseline")
@dataclass(frozen=True)
class Baseline(AxisModels):
    """Six states [p, v], driven by the gravity-compensated acceleration u.

    For each axis, with b = [dt^2/2, dt]::

        x = [[1, dt], [0, 1]] x + b u,    Q = sigma_a^2 (dt0/dt) b b'

    sigma_a is the noise of one IMU sample at the nominal interval dt0; the factor dt0/dt keeps the velocity variance of
    a sample when a measurement splits it. Everything that u gets wrong (noise, bias, leaking gravity) has to fit into
    sigma_a, so this filter is as good as its tuning: sweep it.

    Source: the 6-state filter that the jerk-augmented one is compared with.

    Attributes:
        accel_mps2: sigma_a, noise of one sample of u [m/s2].
    """

    provenance = Provenance("published", "Candan, Atallah, Servadio and Arabi")

    accel_mps2: Annotated[
        float,
        ACCEL,
        DefaultOrigin(
            "tuned by hand on the simulated field: near the best of the nominal case (0.1), and not lost under a bias"
        ),
    ] = 0.2

    def __post_init__(self) -> None:
        """Check that every noise is a number, and not negative."""
        require_not_negative("filter baseline", self, ("accel_mps2",))

    def axis_models(self, dt: FloatArray, dt0: float) -> Models:
        """Return A (k, 2, 2), b (k, 2), Q (k, 2, 2) for steps of ``dt`` (k,) seconds."""
        A = identities(dt, 2)
        A[:, 0, 1] = dt
        b = np.stack([0.5 * dt**2, dt], axis=1)
        return A, b, outer(self.accel_mps2**2 * (dt0 / dt), b)

    def initial_variances(self) -> FloatArray:
        """Return no variance: both states are measured."""
        return np.zeros(0)
