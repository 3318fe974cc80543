"""The baseline with a free process noise: what an optimised Kalman filter tunes."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.filters.common import AxisModels, Models, identities
from jerkbench.parameters import NOT_NEGATIVE, DefaultOrigin, Limit, Provenance, Range
from jerkbench.plugins import register

AS_BASELINE = DefaultOrigin("that of `baseline` at its default and 100 Hz")


@register("filter", "okf")
@dataclass(frozen=True)
class OptimisedKalmanFilter(AxisModels):
    """Six states [p, v], as `baseline` has them, with a process noise that is free: made to be tuned.

    For each axis, with b = [dt^2/2, dt]::

        x = [[1, dt], [0, 1]] x + b u
        Q = dt [[q_p^2, rho q_p q_v], [rho q_p q_v, q_v^2]]

    A filter's noises are parameters to be optimised on true errors, not properties of sensors to be estimated; whoever
    optimises a method and only estimates the noises of the Kalman filter beside it compares unlike things. `jerkbench
    tune filter=okf` is that optimisation: it tries the three numbers of Q and the two factors on R (position, velocity)
    on some drives, by their true errors, and scores the chosen ones on others. Untuned it is `baseline`, all but
    exactly.

    Source: I. Greenberg, N. Yannay, S. Mannor, "Optimization or architecture: how to hack Kalman filtering", NeurIPS
    2023, doi:10.48550/arXiv.2310.00675. Theirs has all elements of Q and R free, by their Cholesky factors, and follows
    gradients. Here all axes have one Q, R keeps the shape that is reported, and the search takes no gradients.

    Attributes:
        position_walk_m_per_sqrt_s: q_p, random walk of the position [m/sqrt(s)].
        velocity_walk_mps_per_sqrt_s: q_v, random walk of the velocity [m/s/sqrt(s)].
        correlation: rho, of the two, from -1 to 1 [-].
    """

    provenance = Provenance(
        "simplified",
        "doi:10.48550/arXiv.2310.00675",
        "One Q for all axes, R but for a factor as reported, no gradients.",
    )

    position_walk_m_per_sqrt_s: Annotated[
        float, Range(1e-5, 1.0, log=True, source="ours: from nothing to a metre in a second"), AS_BASELINE, NOT_NEGATIVE
    ] = 1e-4
    velocity_walk_mps_per_sqrt_s: Annotated[
        float,
        Range(1e-3, 1.0, log=True, source="ours: that of `baseline`, .01 to 10 m/s2 at 100 Hz"),
        AS_BASELINE,
        NOT_NEGATIVE,
    ] = 0.02
    correlation: Annotated[
        float,
        Range(-0.99, 0.99, source="ours: all but singular"),
        AS_BASELINE,
        Limit(lambda rho: -1.0 <= rho <= 1.0, "it must be from -1 to 1."),
    ] = 0.99

    def axis_models(self, dt: FloatArray, dt0: float) -> Models:
        """Return A (k, 2, 2), b (k, 2), Q (k, 2, 2) for steps of ``dt`` (k,) seconds."""
        q_p, q_v, rho = self.position_walk_m_per_sqrt_s, self.velocity_walk_mps_per_sqrt_s, self.correlation
        A = identities(dt, 2)
        A[:, 0, 1] = dt
        b = np.stack([0.5 * dt**2, dt], axis=1)
        Q = np.array([[q_p**2, rho * q_p * q_v], [rho * q_p * q_v, q_v**2]])
        return A, b, dt[:, None, None] * Q

    def initial_variances(self) -> FloatArray:
        """Return no variance: both states are measured."""
        return np.zeros(0)
