"""The kinematic filters: position and velocity, and what else each takes for a state."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.filters.common import (
    ACCEL_RANGE,
    ACCEL_WALK,
    BIAS_WALK,
    FIELD,
    JERK_WALK,
    START,
    VELOCITY_WALK,
    WALK,
    AxisModels,
    Models,
    identities,
    outer,
)
from jerkbench.parameters import NOT_NEGATIVE, DefaultOrigin, Limited, Provenance
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
        ACCEL_RANGE,
        NOT_NEGATIVE,
        DefaultOrigin(
            "tuned by hand on the simulated field: near the best of the nominal case (0.1), and not lost under a bias"
        ),
    ] = 0.2

    def axis_models(self, dt: FloatArray, dt0: float) -> Models:
        """Return A (k, 2, 2), b (k, 2), Q (k, 2, 2) for steps of ``dt`` (k,) seconds."""
        A = identities(dt, 2)
        A[:, 0, 1] = dt
        b = np.stack([0.5 * dt**2, dt], axis=1)
        return A, b, outer(self.accel_mps2**2 * (dt0 / dt), b)

    def initial_variances(self) -> FloatArray:
        """Return no variance: both states are measured."""
        return np.zeros(0)


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

    accel_mps2: Annotated[float, ACCEL_RANGE, FIELD, NOT_NEGATIVE] = 0.1
    bias_mps2_per_sqrt_s: Annotated[float, BIAS_WALK, FIELD, NOT_NEGATIVE] = 0.03
    initial_bias_mps2: Annotated[float, START, NOT_NEGATIVE] = 0.1

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

    accel_mps2: Annotated[float, ACCEL_RANGE, FIELD, NOT_NEGATIVE] = 0.1
    jerk_mps3_per_sqrt_s: Annotated[float, JERK_WALK, FIELD, NOT_NEGATIVE] = 6.0
    initial_jerk_mps3: Annotated[float, START, NOT_NEGATIVE] = 20.0

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

    accel_walk_mps2_per_sqrt_s: Annotated[float, ACCEL_WALK, WALK, NOT_NEGATIVE] = 2.0
    initial_accel_mps2: Annotated[float, START, NOT_NEGATIVE] = 1.0

    def axis_models(self, dt: FloatArray, dt0: float) -> Models:
        """Return A (k, 3, 3), b (k, 3), Q (k, 3, 3) for steps of ``dt`` (k,) seconds."""
        A = identities(dt, 3)
        A[:, 0, 1], A[:, 0, 2], A[:, 1, 2] = dt, 0.5 * dt**2, dt
        q = np.stack([0.5 * dt**2, dt, np.ones_like(dt)], axis=1)
        return A, np.zeros_like(q), outer(self.accel_walk_mps2_per_sqrt_s**2 * dt, q)

    def initial_variances(self) -> FloatArray:
        """Return (1,) the initial variance of the acceleration."""
        return np.array([self.initial_accel_mps2**2])


@register("filter", "constant_velocity")
@dataclass(frozen=True)
class ConstantVelocity(Limited):
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
        NOT_NEGATIVE,
        DefaultOrigin("the source's rule: a car that changes its velocity by 1 m/s within a second"),
    ] = 1.0

    def axis_model(self, dt: float, dt0: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A (2, 2), b (2,), Q (2, 2) for a step of ``dt`` seconds."""
        A = np.array([[1.0, dt], [0.0, 1.0]])
        Q = np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
        return A, np.zeros(2), self.velocity_walk_mps_per_sqrt_s**2 * Q

    def initial_variances(self) -> FloatArray:
        """Return (0,): there are no states after position and velocity."""
        return np.zeros(0)
