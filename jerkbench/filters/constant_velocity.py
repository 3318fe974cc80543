"""A filter that takes no input and has no more than position and velocity."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import FloatArray, require_not_negative
from jerkbench.filters.common import VELOCITY_WALK
from jerkbench.parameters import DefaultOrigin, Provenance
from jerkbench.plugins import register


@register("filter", "constant_velocity")
@dataclass(frozen=True)
class ConstantVelocity:
    """Six states [p, v]: the acceleration is white noise, and the IMU is not used.

    For each axis, without an input (b = 0)::

        x = [[1, dt], [0, 1]] x
        Q = q^2 [[dt^3/3, dt^2/2], [dt^2/2, dt]]

    Two steps of dt/2 are one of dt. It is the plainest filter of fixes alone, and runs over recordings without an IMU.

    Source: the continuous white-noise acceleration model (Bar-Shalom, Li and Kirubarajan, "Estimation with Applications
    to Tracking and Navigation", 6.2.2, doi:10.1002/0471221279), where q^2 of a vehicle that changes its velocity by
    dv within T is about dv^2/T.

    Attributes:
        velocity_walk_mps_per_sqrt_s: q, random walk of the velocity [m/s/sqrt(s)]; a car's 1 m/s2 over a second is 1.
    """

    provenance = Provenance("published", "doi:10.1002/0471221279")

    uses_imu: ClassVar[bool] = False

    velocity_walk_mps_per_sqrt_s: Annotated[
        float,
        VELOCITY_WALK,
        DefaultOrigin("the source's rule: a car that changes its velocity by 1 m/s within a second"),
    ] = 1.0

    def __post_init__(self) -> None:
        """Check that the noise is a number, and not negative."""
        require_not_negative("filter constant_velocity", self, ("velocity_walk_mps_per_sqrt_s",))

    def axis_model(self, dt: float, dt0: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A (2, 2), b (2,), Q (2, 2) for a step of ``dt`` seconds."""
        A = np.array([[1.0, dt], [0.0, 1.0]])
        Q = np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
        return A, np.zeros(2), self.velocity_walk_mps_per_sqrt_s**2 * Q

    def initial_variances(self) -> FloatArray:
        """Return (0,): there are no states after position and velocity."""
        return np.zeros(0)
