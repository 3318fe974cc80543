"""The kinematic filters: linear filters with position, velocity, and at most one more state per axis."""

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
from jerkbench.parameters import NOT_NEGATIVE, DefaultOrigin, Limit, Limited, Provenance, Range
from jerkbench.plugins import register


@register("filter", "baseline")
@dataclass(frozen=True)
class Baseline(AxisModels):
    """Six states [p, v], driven by the gravity-compensated acceleration u.

    The following equations define one prediction step of each axis, with b = [dt^2/2, dt]::

        x = [[1, dt], [0, 1]] x + b u,    Q = sigma_a^2 (dt0/dt) b b'

    sigma_a is the standard deviation of the noise of one acceleration sample at the nominal sampling interval dt0. If a
    measurement divides a sample into several steps, the factor dt0/dt ensures that the total velocity variance of the
    sample does not change. The parameter sigma_a has to cover all errors of u (noise, bias, and gravity due to attitude
    errors), so the accuracy of this filter depends strongly on its tuning.

    Source: the 6-state filter with which Candan, Atallah, Servadio and Arabi compare the jerk-augmented filter.

    Attributes:
        accel_mps2: sigma_a, noise of one sample of the acceleration u [m/s2].
    """

    provenance = Provenance("published", "Candan, Atallah, Servadio and Arabi")

    accel_mps2: Annotated[
        float,
        ACCEL_RANGE,
        NOT_NEGATIVE,
        DefaultOrigin(
            "tuned by hand on the simulated field: near the best nominal value (0.1), and no divergence under a bias"
        ),
    ] = 0.2

    def axis_models(self, dt: FloatArray, dt0: float) -> Models:
        """Return A (k, 2, 2), b (k, 2) and Q (k, 2, 2) of one axis for k steps of ``dt`` (k,) seconds."""
        A = identities(dt, 2)
        A[:, 0, 1] = dt
        b = np.stack([0.5 * dt**2, dt], axis=1)
        return A, b, outer(self.accel_mps2**2 * (dt0 / dt), b)


@register("filter", "bias")
@dataclass(frozen=True)
class Bias(AxisModels):
    """Nine states [p, v, b]: the baseline with an ENU acceleration bias that is a random walk.

    The following equations define one prediction step of each axis, with b = [dt^2/2, dt, 0]::

        x = [[1, dt, dt^2/2], [0, 1, dt], [0, 0, 1]] x + b u
        Q = sigma_a^2 (dt0/dt) b b' + diag(0, 0, sigma_b^2 dt)

    This filter is the control for the filter `jerk`, whose third state acts as an acceleration bias j dt/2. With
    sigma_b = sigma_j dt/2, the filters `bias` and `jerk` are identical. If `bias` and `jerk` give the same result,
    their improvement over `baseline` is due to the estimated bias and not to the model of the jerk.

    Source: the augmented-state treatment of a constant input error (B. Friedland, 1969, doi:10.1109/TAC.1969.1099223).

    Attributes:
        accel_mps2: sigma_a, noise of one sample of the acceleration u [m/s2].
        bias_mps2_per_sqrt_s: sigma_b, intensity of the random walk of the bias [m/s2/sqrt(s)].
        initial_bias_mps2: standard deviation of the initial bias [m/s2].
    """

    provenance = Provenance(
        "simplified", "doi:10.1109/TAC.1969.1099223", "The bias is a random walk and is part of the state."
    )

    accel_mps2: Annotated[float, ACCEL_RANGE, FIELD, NOT_NEGATIVE] = 0.1
    bias_mps2_per_sqrt_s: Annotated[float, BIAS_WALK, FIELD, NOT_NEGATIVE] = 0.03
    initial_bias_mps2: Annotated[float, START, NOT_NEGATIVE] = 0.1

    def axis_models(self, dt: FloatArray, dt0: float) -> Models:
        """Return A (k, 3, 3), b (k, 3) and Q (k, 3, 3) of one axis for k steps of ``dt`` (k,) seconds."""
        A = identities(dt, 3)
        A[:, 0, 1], A[:, 0, 2], A[:, 1, 2] = dt, 0.5 * dt**2, dt
        b = np.stack([0.5 * dt**2, dt, np.zeros_like(dt)], axis=1)
        Q = outer(self.accel_mps2**2 * (dt0 / dt), b)
        Q[:, 2, 2] += self.bias_mps2_per_sqrt_s**2 * dt
        return A, b, Q

    def initial_variances(self) -> FloatArray:
        """Return an array (1,) with the initial variance of the bias."""
        return np.array([self.initial_bias_mps2**2])


@register("filter", "jerk")
@dataclass(frozen=True)
class Jerk(AxisModels):
    """Nine states [p, v, j]: the baseline with a jerk that is a random walk.

    The following equations define one prediction step of each axis, with b = [dt^2/2, dt, 0]::

        x = [[1, dt, dt^3/6], [0, 1, dt^2/2], [0, 0, 1]] x + b u
        Q = sigma_a^2 (dt0/dt) b b' + diag(0, 0, sigma_j^2 dt)

    The state does not include an acceleration, so the filter does not integrate the jerk into an acceleration. In each
    step, the jerk adds j dt^2/2 to the velocity, which is the effect of an acceleration bias of j dt/2. The filter
    `bias` models this acceleration bias explicitly and is the control for the filter `jerk`.

    Source: the jerk-augmented extended Kalman filter of Candan, Atallah, Servadio and Arabi, "Resilient Navigation for
    Autonomous Farm Robots by Leveraging Jerk-Augmented Models with IMU-Only Disturbance Rejection".

    Attributes:
        accel_mps2: sigma_a, noise of one sample of the acceleration u [m/s2].
        jerk_mps3_per_sqrt_s: sigma_j, intensity of the random walk of the jerk [m/s3/sqrt(s)].
        initial_jerk_mps3: standard deviation of the initial jerk [m/s3].
    """

    provenance = Provenance("published", "Candan, Atallah, Servadio and Arabi")

    accel_mps2: Annotated[float, ACCEL_RANGE, FIELD, NOT_NEGATIVE] = 0.1
    jerk_mps3_per_sqrt_s: Annotated[float, JERK_WALK, FIELD, NOT_NEGATIVE] = 6.0
    initial_jerk_mps3: Annotated[float, START, NOT_NEGATIVE] = 20.0

    def axis_models(self, dt: FloatArray, dt0: float) -> Models:
        """Return A (k, 3, 3), b (k, 3) and Q (k, 3, 3) of one axis for k steps of ``dt`` (k,) seconds."""
        A = identities(dt, 3)
        A[:, 0, 1], A[:, 0, 2], A[:, 1, 2] = dt, dt**3 / 6.0, 0.5 * dt**2
        b = np.stack([0.5 * dt**2, dt, np.zeros_like(dt)], axis=1)
        Q = outer(self.accel_mps2**2 * (dt0 / dt), b)
        Q[:, 2, 2] += self.jerk_mps3_per_sqrt_s**2 * dt
        return A, b, Q

    def initial_variances(self) -> FloatArray:
        """Return an array (1,) with the initial variance of the jerk."""
        return np.array([self.initial_jerk_mps3**2])


@register("filter", "acceleration")
@dataclass(frozen=True)
class Acceleration(AxisModels):
    """Nine states [p, v, a]: the acceleration is a random walk, and the IMU is not used.

    The following equations define one prediction step of each axis, with q = [dt^2/2, dt, 1] and without an input (b =
    0)::

        x = [[1, dt, dt^2/2], [0, 1, dt], [0, 0, 1]] x
        Q = sigma_w^2 dt q q'

    The filter uses neither the attitude nor the accelerometer, so the errors of attitude and accelerometer have no
    effect. Between position fixes and in an outage, the predicted acceleration is constant. The difference between the
    errors of this filter and of `baseline` shows the benefit of the IMU.

    Source: the Wiener-process acceleration model (Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to
    Tracking and Navigation", 6.3, doi:10.1002/0471221279), which is the "9-state" filter in the related work of the
    paper on the filter `jerk`.

    Attributes:
        accel_walk_mps2_per_sqrt_s: sigma_w, intensity of the random walk of the acceleration [m/s2/sqrt(s)].
        initial_accel_mps2: standard deviation of the initial acceleration [m/s2].
    """

    provenance = Provenance("published", "doi:10.1002/0471221279")

    uses_imu: ClassVar[bool] = False

    accel_walk_mps2_per_sqrt_s: Annotated[float, ACCEL_WALK, WALK, NOT_NEGATIVE] = 2.0
    initial_accel_mps2: Annotated[float, START, NOT_NEGATIVE] = 1.0

    def axis_models(self, dt: FloatArray, dt0: float) -> Models:
        """Return A (k, 3, 3), b (k, 3) and Q (k, 3, 3) of one axis for k steps of ``dt`` (k,) seconds."""
        A = identities(dt, 3)
        A[:, 0, 1], A[:, 0, 2], A[:, 1, 2] = dt, 0.5 * dt**2, dt
        q = np.stack([0.5 * dt**2, dt, np.ones_like(dt)], axis=1)
        return A, np.zeros_like(q), outer(self.accel_walk_mps2_per_sqrt_s**2 * dt, q)

    def initial_variances(self) -> FloatArray:
        """Return an array (1,) with the initial variance of the acceleration."""
        return np.array([self.initial_accel_mps2**2])


@register("filter", "constant_velocity")
@dataclass(frozen=True)
class ConstantVelocity(Limited):
    """Six states [p, v]: the acceleration is white noise, and the IMU is not used.

    The following equations define one prediction step of each axis, without an input (b = 0)::

        x = [[1, dt], [0, 1]] x
        Q = q^2 [[dt^3/3, dt^2/2], [dt^2/2, dt]]

    Two prediction steps of dt/2 are equivalent to one step of dt. This filter is the simplest filter over position
    fixes, and can be used for recordings without an IMU.

    Source: the continuous white-noise acceleration model (Bar-Shalom, Li and Kirubarajan, "Estimation with Applications
    to Tracking and Navigation", 6.2.2, doi:10.1002/0471221279). For a vehicle that changes its velocity by dv within
    the time T, q^2 is about dv^2/T.

    Attributes:
        velocity_walk_mps_per_sqrt_s: q, intensity of the random walk of the velocity [m/s/sqrt(s)]. The value 1
            describes a car that changes its velocity by 1 m/s within a second.
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
        """Return A (2, 2), b (2,) and Q (2, 2) of one axis for a step of ``dt`` seconds."""
        A = np.array([[1.0, dt], [0.0, 1.0]])
        Q = np.array([[dt**3 / 3.0, dt**2 / 2.0], [dt**2 / 2.0, dt]])
        return A, np.zeros(2), self.velocity_walk_mps_per_sqrt_s**2 * Q

    def initial_variances(self) -> FloatArray:
        """Return an empty array (0,), because the filter has no third state."""
        return np.zeros(0)


AS_BASELINE = DefaultOrigin("equivalent to the default of `baseline` at 100 Hz")


@register("filter", "okf")
@dataclass(frozen=True)
class OptimisedKalmanFilter(AxisModels):
    """Six states [p, v] as in `baseline`, with free parameters of the process noise for tuning.

    The following equations define one prediction step of each axis, with b = [dt^2/2, dt]::

        x = [[1, dt], [0, 1]] x + b u
        Q = dt [[q_p^2, rho q_p q_v], [rho q_p q_v, q_v^2]]

    Greenberg et al. propose to optimise the noise parameters of a Kalman filter on its true errors instead of
    estimating the noise of the sensors. It is not fair to compare an optimised method with a Kalman filter whose noise
    parameters are only estimated. The command `jerkbench tune filter=okf` optimises the three parameters of Q, a factor
    of the R of the position, and a factor of the R of the velocity. The command `jerkbench tune` minimises the true
    errors on some drives and evaluates the result on other drives. With the default parameters, the filter is nearly
    identical to `baseline`.

    Source: I. Greenberg, N. Yannay, S. Mannor, "Optimization or architecture: how to hack Kalman filtering", NeurIPS
    2023, doi:10.48550/arXiv.2310.00675. Greenberg et al. optimise all elements of the Cholesky factors of Q and R with
    gradients. In `okf`, all axes have the same Q, R is the reported covariance times a factor, and the search uses no
    gradients.

    Attributes:
        position_walk_m_per_sqrt_s: q_p, intensity of the random walk of the position [m/sqrt(s)].
        velocity_walk_mps_per_sqrt_s: q_v, intensity of the random walk of the velocity [m/s/sqrt(s)].
        correlation: rho, correlation between the random walks of position and velocity, from -1 to 1 [-].
    """

    provenance = Provenance(
        "simplified", "doi:10.48550/arXiv.2310.00675", "One Q for all axes, R as reported times a factor, no gradients."
    )

    position_walk_m_per_sqrt_s: Annotated[
        float, Range(1e-5, 1.0, log=True, source="ours: from nearly 0 to 1 m within 1 s"), AS_BASELINE, NOT_NEGATIVE
    ] = 1e-4
    velocity_walk_mps_per_sqrt_s: Annotated[
        float,
        Range(1e-3, 1.0, log=True, source="ours: equivalent to 0.01 to 10 m/s2 of `baseline` at 100 Hz"),
        AS_BASELINE,
        NOT_NEGATIVE,
    ] = 0.02
    correlation: Annotated[
        float,
        Range(-0.99, 0.99, source="ours: almost up to a singular Q"),
        AS_BASELINE,
        Limit(lambda rho: -1.0 <= rho <= 1.0, "it must be from -1 to 1."),
    ] = 0.99

    def axis_models(self, dt: FloatArray, dt0: float) -> Models:
        """Return A (k, 2, 2), b (k, 2) and Q (k, 2, 2) of one axis for k steps of ``dt`` (k,) seconds."""
        q_p, q_v, rho = self.position_walk_m_per_sqrt_s, self.velocity_walk_mps_per_sqrt_s, self.correlation
        A = identities(dt, 2)
        A[:, 0, 1] = dt
        b = np.stack([0.5 * dt**2, dt], axis=1)
        Q = np.array([[q_p**2, rho * q_p * q_v], [rho * q_p * q_v, q_v**2]])
        return A, b, dt[:, None, None] * Q
