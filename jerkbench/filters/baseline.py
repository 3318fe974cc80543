"""The baseline: position and velocity, driven by the measured acceleration."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.checks import require_not_negative
from jerkbench.plugins import register


@register("filter", "baseline")
@dataclass(frozen=True)
class Baseline:
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

    accel_mps2: float = 0.2

    def __post_init__(self) -> None:
        """Check that every noise is a number, and not negative."""
        require_not_negative("filter baseline", self, ("accel_mps2",))

    def axis_model(self, dt: float, dt0: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A (2, 2), b (2,), Q (2, 2) for a step of ``dt`` seconds."""
        A = np.array([[1.0, dt], [0.0, 1.0]])
        b = np.array([0.5 * dt**2, dt])
        return A, b, self.accel_mps2**2 * (dt0 / dt) * np.outer(b, b)

    def initial_variances(self) -> FloatArray:
        """Return no variance: both states are measured."""
        return np.zeros(0)
