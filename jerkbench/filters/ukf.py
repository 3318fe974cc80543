"""The unscented Kalman filter for inertial navigation, which uses filterpy's UKF over the error state of `eskf15`."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Adaptation
from jerkbench.errors import notify
from jerkbench.estimate import Attitude, Estimate
from jerkbench.filters.eskf15 import InertialFilter
from jerkbench.geometry import wrap_angle
from jerkbench.inertial.run import InertialRun
from jerkbench.inertial.run_inputs import Events, InertialInputs
from jerkbench.inertial.state import (
    BA,
    BG,
    GYRO,
    PHI,
    STATES,
    NavigationState,
    P,
    V,
    added,
    process_noise,
    rotation_exp,
)
from jerkbench.inertial.update import heading, velocity_in_body
from jerkbench.parameters import DefaultOrigin, Limit, Provenance, Range
from jerkbench.plugins import register
from jerkbench.recording import GRAVITY_MPS2, Recording

LITERATURE = "literature: Wan and van der Merwe 2000 for a Gaussian prior"

MINUS_STATES = Limit(lambda kappa: kappa > -15.0, "it must be above -15, minus the number of states.")


@register("filter", "ukf")
@dataclass(frozen=True)
class Ukf(InertialFilter):
    """Inertial navigation with an unscented Kalman filter, whose error state has the attitude as a rotation vector.

    The nominal state, the measurements, the initialisation and the parameters are the same as in `eskf15`. The
    estimation of the wheel scale and the compensation of the Earth's rotation and curvature are not supported. Sigma
    points replace the matrices Phi and H. The following equations define the sigma points dx_i and their weights, with
    n = 15 states::

        dx_0 = 0,  dx_i = +-row i of the Cholesky factor of (n + lambda) P;  lambda = alpha^2 (n + kappa) - n
        weights: W_0 = lambda/(n + lambda) (for P: + 1 - alpha^2 + beta), otherwise 1/(2 (n + lambda))

    Each error dx_i is applied to the nominal state. The attitude of sigma point i is C_i = Exp(phi_i) C, and the other
    components of dx_i are added to the nominal state. The state of each sigma point is propagated over every IMU sample
    with the strapdown equations. The propagated state is converted back into an error about sigma point 0, where phi_i
    is the rotation vector of C_i C_0'. The unscented transform of filterpy computes the mean and the covariance of the
    propagated errors, and the filter adds the Q of `eskf15` to the covariance. filterpy also computes the measurement
    update, with the predicted measurement h(x) of each sigma point. The updated mean is applied to the nominal state
    immediately, and P is then computed about the new nominal state.

    If the attitude is known to a few degrees, the result is nearly the same as with `eskf15`. The UKF needs no
    derivatives and includes the second-order effects of a large error of the initial yaw. All adaptations that change
    only R are supported.

    filterpy processes the sigma points one after the other. With either engine, the UKF is therefore about 30 times
    slower than `eskf15` in NumPy and 1000 times slower than the compiled `eskf15`. The filter prints its progress every
    10 s.

    Source: E. A. Wan, R. van der Merwe, "The unscented Kalman filter for nonlinear estimation", AS-SPCC 2000,
    doi:10.1109/ASSPCC.2000.882463; attitude errors as the state: J. L. Crassidis, F. L. Markley, "Unscented filtering
    for spacecraft attitude estimation", Journal of Guidance, Control, and Dynamics 26(4), 2003, doi:10.2514/2.5102;
    filterpy 2 by R. R. Labbe (MIT).

    Attributes:
        alpha: spread of the sigma points, which lie at alpha sqrt(n + kappa) standard deviations [-].
        beta: parameter of the covariance weight of sigma point 0; the value 2 is optimal for a Gaussian prior [-].
        kappa: secondary scaling parameter, which increases the weight of sigma point 0 [-].
    """

    provenance = Provenance("simplified", "doi:10.1109/ASSPCC.2000.882463", "Over the error state of `eskf15`.")

    title: ClassVar[str] = "ukf"
    unsupported: ClassVar[tuple[str, ...]] = ("wheel_scale", "earth_rotation", "earth_curvature")

    alpha: Annotated[
        float,
        Limit(lambda alpha: 0.0 < alpha <= 1.0, "it must be above 0 and at most 1."),
        Range(0.01, 1.0, log=True, source="the paper: 1e-4 to 1; below 0.01 double precision is not enough"),
        DefaultOrigin("ours: within the range 1e-4 to 1 of the paper, and large enough for double precision"),
    ] = 0.1
    beta: Annotated[float, DefaultOrigin(LITERATURE)] = 2.0
    kappa: Annotated[float, DefaultOrigin(LITERATURE), MINUS_STATES] = 0.0

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the navigation solution at the time stamps of the reference."""
        from filterpy.kalman import MerweScaledSigmaPoints  # this import takes a second, because it loads pyplot

        points = MerweScaledSigmaPoints(15, self.alpha, self.beta, self.kappa)
        return UnscentedRun(self.inputs(recording, attitude), adaptation, points).solve().estimate


# A sigma point is an error dx = [dp, dv, phi, db_g, db_a] of the nominal state, with the attitude C+ = Exp(phi) C.
# Attitudes are averaged as rotation vectors about the nominal attitude, not as Euler angles.
# Sigma point 0 is the nominal state, because each correction is applied to the nominal state immediately.

PROGRESS_INTERVAL_S = 10.0
"""Time between two progress messages [s]."""


def step_all(
    state: NavigationState, sigmas: FloatArray, accel_mps2: FloatArray, gyro_radps: FloatArray, dt_s: float
) -> tuple[NavigationState, FloatArray]:
    """Propagate the nominal state and all sigma points over one time step.

    The equations are the same as in `jerkbench.inertial.state.advance_navigation` in a tangent plane::

        C+ = C Exp(w dt);  v+ = v + ((C + C+)/2 f + g) dt;  p+ = p + (v + v+)/2 dt

    Args:
        state: nominal state, which is equal to sigma point 0.
        sigmas: (k, 15) sigma points as errors of the nominal state.
        accel_mps2: (3,) measurement of the accelerometer [m/s2].
        gyro_radps: (3,) measurement of the gyro [rad/s].
        dt_s: length of the time step [s].

    Returns:
        The nominal state after the step, and the sigma points (k, 15) as errors of this new nominal state.
    """
    dcm = rotation_exp(sigmas[:, PHI]) @ state.dcm
    rate = gyro_radps - state.gyro_bias_radps - sigmas[:, BG]
    force = accel_mps2 - state.accel_bias_mps2 - sigmas[:, BA]
    rotated = dcm @ rotation_exp(rate * dt_s)
    gain = np.einsum("kij,kj->ki", 0.5 * (dcm + rotated), force) * dt_s
    gain[:, 2] -= GRAVITY_MPS2 * dt_s
    v = state.velocity_mps + sigmas[:, V]
    p = state.position_m + sigmas[:, P] + (v + 0.5 * gain) * dt_s
    v = v + gain
    errors = np.hstack([p - p[0], v - v[0], rotation_vectors(rotated @ rotated[0].T), sigmas[:, GYRO:]])
    return state._replace(position_m=p[0], velocity_mps=v[0], dcm=rotated[0]), errors


def rotation_vectors(dcm: FloatArray) -> FloatArray:
    """Return the rotation vectors (k, 3) of rotation matrices (k, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(dcm).as_rotvec(), dtype=np.float64)


class UnscentedRun(InertialRun):
    """One run of the unscented Kalman filter.

    The base class `InertialRun` processes the measurements and the constraints in the order of time. This class
    replaces the prediction and the measurement update of the base class.
    """

    def __init__(self, inputs: InertialInputs, adaptation: Adaptation, points: Any) -> None:  # noqa: ANN401 - filterpy's
        """Initialise the run and the UKF of filterpy.

        Args:
            inputs: inputs of the run.
            adaptation: adaptation of the measurement covariance R.
            points: filterpy's generator of the sigma points for 15 states.
        """
        from filterpy.kalman import UnscentedKalmanFilter

        super().__init__(inputs, adaptation)
        self.points = points
        self.ukf = UnscentedKalmanFilter(STATES, 6, 0.0, None, None, points)
        self.ukf.compute_process_sigmas = self._move_sigmas
        self.sample, self.progress_s, self.end_s = 0, time.monotonic(), float(inputs.events.t_s[-1])

    def _predict(self, events: Events, start: int, last: int) -> None:
        for k in range(start, last + 1):
            self._step(float(events.dt_s[k]), int(events.sample[k]))
            if k < last and events.reference[k] >= 0:
                self._store(int(events.reference[k]))
        if time.monotonic() - self.progress_s > PROGRESS_INTERVAL_S:
            self.progress_s = time.monotonic()
            notify(f"ukf: {events.t_s[last]:.0f} of {self.end_s:.0f} s")

    def _step(self, dt_s: float, sample: int) -> None:
        self.sample = sample
        if dt_s > 0.0:
            self.ukf.x, self.ukf.P = np.zeros(STATES), self.P
            self.ukf.Q = process_noise(self.settings.noise, dt_s)
            self.ukf.predict(dt=dt_s)
            self.state = added(self.state, self.ukf.x)  # the mean error of a prediction, which is of second order
            self.P = 0.5 * (self.ukf.P + self.ukf.P.T)
        self.rate = self.imu.gyro_radps[sample] - self.state.gyro_bias_radps

    def _move_sigmas(self, dt: float, fx: None = None) -> None:
        """Propagate all sigma points in one call. The original method of filterpy calls ``fx`` for each sigma point."""
        del fx
        sigmas = self.points.sigma_points(self.ukf.x, self.ukf.P)
        sensed = self.imu.accel_mps2[self.sample], self.imu.gyro_radps[self.sample]
        self.state, self.ukf.sigmas_f = step_all(self.state, sigmas, *sensed, dt)

    def _recentre(self) -> None:
        """Apply the mean error of an update to the nominal state, and compute the covariance about the new state."""
        from filterpy.kalman import unscented_transform

        sigmas = self.points.sigma_points(self.ukf.x, 0.5 * (self.ukf.P + self.ukf.P.T))
        turn = rotation_exp(sigmas[:, PHI])
        self.state = added(self.state, sigmas[0])
        sigmas[:, PHI] = rotation_vectors(turn @ turn[0].T)
        for part in (P, V, BG, BA):
            sigmas[:, part] -= sigmas[0, part]
        _, covariance = unscented_transform(sigmas, self.ukf.Wm, self.ukf.Wc)
        self.P = 0.5 * (covariance + covariance.T)

    def _expect(self, dx: FloatArray) -> FloatArray:
        """Return the predicted measurement (6,) of position and velocity for the sigma point ``dx``."""
        return self._predict_measurement(added(self.state, dx), self.rate - dx[BG])[0]

    def _innovate(self, z: FloatArray, expect: Callable[[FloatArray], FloatArray]) -> tuple[FloatArray, FloatArray]:
        """Return the innovation (m,) of the measurement ``z``, and its covariance (m, m) without R, by sigma points."""
        from filterpy.kalman import unscented_transform

        self.ukf.x, self.ukf.P = np.zeros(STATES), self.P
        self.ukf.sigmas_f = self.points.sigma_points(self.ukf.x, self.P)
        mean, covariance = unscented_transform(
            np.array([expect(dx) for dx in self.ukf.sigmas_f]), self.ukf.Wm, self.ukf.Wc
        )
        return z - mean, covariance

    def _update(self, update: int) -> None:
        _, R, rows = self.updates.take(update, lambda z, rows: self._innovate(z, lambda dx: self._expect(dx)[rows]))
        if rows.size:
            z = self.timeline.measurements.z[update, rows]
            self._take_rows(z, R, lambda dx: self._expect(dx)[rows])

    def _take_rows(self, z: FloatArray, R: FloatArray, expect: Callable[[FloatArray], FloatArray]) -> None:
        self.ukf.update(z, R=R, hx=expect)
        self._recentre()

    def _take_unadapted(self, z: FloatArray, R: FloatArray, expect: Callable[[FloatArray], FloatArray]) -> None:
        """Update with measurements that are not passed to the adaptation."""
        self._innovate(z, expect)
        self._take_rows(z, R, expect)

    def _update_heading(self, yaw_rad: float, sigma_rad: float) -> None:
        nominal_rad, _ = heading(self.state)

        def relative_heading(dx: FloatArray) -> FloatArray:
            return np.array([wrap_angle(np.array(heading(added(self.state, dx))[0] - nominal_rad))])

        innovation = wrap_angle(np.array([yaw_rad - nominal_rad]))
        self._take_unadapted(innovation, np.array([[sigma_rad**2]]), relative_heading)

    def _constrain(self, sample: int) -> None:
        """Apply a zero-velocity update if the vehicle is stationary, otherwise the non-holonomic constraint."""
        limits = self.settings.constraints
        if limits.still[sample] and np.linalg.norm(self.state.velocity_mps) < limits.still_below_mps:
            R = limits.still_sigma_mps**2 * np.eye(3)
            self._take_unadapted(np.zeros(3), R, lambda dx: self.state.velocity_mps + dx[V])
        elif limits.sideways_sigma_mps > 0:
            self._take_unadapted(np.zeros(2), limits.sideways_sigma_mps**2 * np.eye(2), self._sideways)

    def _sideways(self, dx: FloatArray) -> FloatArray:
        point_m = self.settings.constraints.sideways_point_m
        h, _ = velocity_in_body(added(self.state, dx), self.rate - dx[BG], point_m)
        return h[1:]
