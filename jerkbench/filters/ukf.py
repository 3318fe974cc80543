"""The unscented inertial navigation: filterpy's UKF over the error state of eskf15."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Adaptation
from jerkbench.estimate import Attitude, Estimate
from jerkbench.filters.eskf15 import InertialFilter
from jerkbench.geometry import wrap_angle
from jerkbench.inertial.run import InertialRun, InertialSolution
from jerkbench.inertial.run_inputs import Events, Journey
from jerkbench.inertial.state import BA, BG, GYRO, PHI, STATES, NavigationState, P, V, added, rotation_exp
from jerkbench.inertial.update import heading, point_in_enu, velocity_in_body, wheel_speed
from jerkbench.notices import notify
from jerkbench.parameters import DefaultOrigin, Limit, Provenance, Range
from jerkbench.plugins import register
from jerkbench.recording import GRAVITY_MPS2, Recording

LITERATURE = "literature: Wan and van der Merwe 2000 for a Gaussian prior"

MINUS_STATES = Limit(lambda kappa: kappa > -15.0, "it must be above -15, minus the number of states.")


@register("filter", "ukf")
@dataclass(frozen=True)
class Ukf(InertialFilter):
    """Inertial navigation by an unscented Kalman filter over the error state, attitudes as rotation vectors.

    The nominal state, the measurements, the start and the parameters are those of `eskf15`; scale factors, a wheel's
    scale and the Earth's turning and curvature it has not. In the place of Phi and H stand sigma points, of n = 15::

        dx_0 = 0,  dx_i = +-row i of the Cholesky factor of (n + lambda) P;  lambda = alpha^2 (n + kappa) - n
        weights: W_0 = lambda/(n + lambda) (for P: + 1 - alpha^2 + beta), else 1/(2 (n + lambda))

    Each dx_i is put into the nominal state (C_i = Exp(phi_i) C, the rest is added), carried over every sample of the
    IMU by the mechanisation itself, and taken back as an error about sigma point 0, phi_i as the rotation vector of
    C_i C_0'. Mean and covariance are filterpy's unscented transform, plus the Q of eskf15. An update is filterpy's too,
    with h(x) of each sigma point; its mean goes into the nominal state at once, and P is taken again about the new one.

    Where the attitude is known to some degrees it is eskf15 with more work; it has no derivative to be wrong, and sees
    the second order of a large first yaw. It takes every adaptation that changes R alone.

    It is slow, because filterpy makes its sigma points one after the other: some thirty times slower than the NumPy way
    of eskf15, a thousand times slower than the compiled one, with either engine. A run that lasts longer than ten
    seconds says every ten how far it has come.

    Source: E. A. Wan, R. van der Merwe, "The unscented Kalman filter for nonlinear estimation", AS-SPCC 2000,
    doi:10.1109/ASSPCC.2000.882463; attitude errors as the state: J. L. Crassidis, F. L. Markley, "Unscented filtering
    for spacecraft attitude estimation", Journal of Guidance, Control, and Dynamics 26(4), 2003, doi:10.2514/2.5102;
    filterpy 2 by R. R. Labbe (MIT).

    Attributes:
        alpha: how far out the sigma points lie, as a part of sqrt(n + kappa) sigmas.
        beta: of the prior's fourth moment; 2 is a Gaussian's.
        kappa: shifts weight to sigma point 0.
    """

    provenance = Provenance("simplified", "doi:10.1109/ASSPCC.2000.882463", "Over the error state of `eskf15`.")

    title: ClassVar[str] = "ukf"
    not_taken: ClassVar[tuple[str, ...]] = ("wheel_scale", "earth_rotation", "earth_curvature")

    alpha: Annotated[
        float,
        Limit(lambda alpha: 0.0 < alpha <= 1.0, "it must be above 0 and at most 1."),
        Range(0.01, 1.0, log=True, source="the paper: 1e-4 to 1; below .01 a double has too few digits"),
        DefaultOrigin("ours: within the paper's 1e-4 to 1, with digits to spare"),
    ] = 0.1
    beta: Annotated[float, DefaultOrigin(LITERATURE)] = 2.0
    kappa: Annotated[float, DefaultOrigin(LITERATURE), MINUS_STATES] = 0.0

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the navigation solution at the reference's stamps."""
        from filterpy.kalman import MerweScaledSigmaPoints  # a second, because it imports pyplot

        points = MerweScaledSigmaPoints(15, self.alpha, self.beta, self.kappa)
        journey = self.journey(recording, attitude)
        return UnscentedRun(journey, adaptation, points).over(journey.events).estimate


# One run. The error dx = [dp, dv, phi, db_g, db_a] of the nominal state has mean zero, because a correction goes into
# that at once; a sigma point is a dx, put into the nominal state by adding, but C+ = Exp(phi) C. So attitudes are
# averaged as rotation vectors about the nominal attitude, never as angles. Sigma point 0 is the nominal state itself.

TELL_EVERY_S = 10.0
"""Between two words on how far a run has come."""


def step_all(
    state: NavigationState, sigmas: FloatArray, accel_mps2: FloatArray, gyro_radps: FloatArray, dt_s: float
) -> tuple[NavigationState, FloatArray]:
    """Carry every sigma point over a step.

    For each, as in `jerkbench.inertial.mechanisation.advance_navigation` over a plane::

        C+ = C Exp(w dt);  v+ = v + ((C + C+)/2 f + g) dt;  p+ = p + (v + v+)/2 dt

    Args:
        state: nominal, which is sigma point 0.
        sigmas: (k, 15) errors of it.
        accel_mps2: (3,) what the accelerometer shows.
        gyro_radps: (3,) what the gyro shows.
        dt_s: length of the step.

    Returns:
        The nominal state after it, and the errors (k, 15) about that.
    """
    dcm = rotation_exp(sigmas[:, PHI]) @ state.dcm
    rate = gyro_radps - state.gyro_bias_radps - sigmas[:, BG]
    force = accel_mps2 - state.accel_bias_mps2 - sigmas[:, BA]
    turned = dcm @ rotation_exp(rate * dt_s)
    gain = np.einsum("kij,kj->ki", 0.5 * (dcm + turned), force) * dt_s
    gain[:, 2] -= GRAVITY_MPS2 * dt_s
    v = state.velocity_mps + sigmas[:, V]
    p = state.position_m + sigmas[:, P] + (v + 0.5 * gain) * dt_s
    v = v + gain
    errors = np.hstack([p - p[0], v - v[0], rotation_vectors(turned @ turned[0].T), sigmas[:, GYRO:]])
    return state._replace(position_m=p[0], velocity_mps=v[0], dcm=turned[0]), errors


def rotation_vectors(dcm: FloatArray) -> FloatArray:
    """Return the rotation vectors (k, 3) of rotations (k, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(dcm).as_rotvec(), dtype=np.float64)


class UnscentedRun(InertialRun):
    """The state of one run, and its steps; `over` of the error-state filter goes through them."""

    def __init__(self, journey: Journey, adaptation: Adaptation, points: Any) -> None:  # noqa: ANN401 - filterpy's
        """Put a run together.

        Args:
            journey: the run.
            adaptation: changes R.
            points: filterpy's sigma points, of 15 states.
        """
        from filterpy.kalman import UnscentedKalmanFilter

        super().__init__(journey, adaptation)
        self.points = points
        self.ukf = UnscentedKalmanFilter(STATES, 6, 0.0, None, None, points)
        self.ukf.compute_process_sigmas = self._move_sigmas
        self.sample, self.told_s = 0, time.monotonic()

    def over(self, events: Events) -> InertialSolution:
        """Go through ``events``; stops at the first sign of divergence."""
        self.end_s = float(events.t_s[-1])
        return super().over(events)

    def _predict(self, events: Events, begin: int, last: int) -> None:
        for k in range(begin, last + 1):
            self._step(float(events.dt_s[k]), int(events.sample[k]))
            if k < last and events.reference[k] >= 0:
                self._keep(int(events.reference[k]))
        if time.monotonic() - self.told_s > TELL_EVERY_S:
            self.told_s = time.monotonic()
            notify(f"ukf: {events.t_s[last]:.0f} of {self.end_s:.0f} s")

    def _step(self, dt_s: float, sample: int) -> None:
        self.sample = sample
        if dt_s > 0.0:
            self.ukf.x, self.ukf.P, self.ukf.Q = np.zeros(STATES), self.P, self._noise(dt_s)
            self.ukf.predict(dt=dt_s)
            self._absorb()
        self.rate = self.imu.gyro_radps[sample] - self.state.gyro_bias_radps

    def _move_sigmas(self, dt: float, fx: None = None) -> None:
        """All sigma points at once, in the place of filterpy's one after the other by ``fx``."""
        del fx
        sigmas = self.points.sigma_points(self.ukf.x, self.ukf.P)
        sensed = self.imu.accel_mps2[self.sample], self.imu.gyro_radps[self.sample]
        self.state, self.ukf.sigmas_f = step_all(self.state, sigmas, *sensed, dt)

    def _absorb(self) -> None:
        """Put the mean error of a prediction, which is of the second order, into the nominal state."""
        self.state = added(self.state, self.ukf.x)
        self.P = 0.5 * (self.ukf.P + self.ukf.P.T)

    def _recentre(self) -> None:
        """Put the mean error of an update into the nominal state, and take the covariance about the new one."""
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
        """The six rows of position and velocity that a sigma point expects."""
        state = added(self.state, dx)
        rate = self.rate - dx[BG]
        h, _ = point_in_enu(state, rate, self.settings.antenna_m)
        if self.settings.velocity_frame == "body":
            h[3:], _ = velocity_in_body(state, rate, np.zeros(3))
        elif self.settings.velocity_frame == "speed":
            h[3:], _ = wheel_speed(state, rate, self.settings.wheel_m)
        return h

    def _innovate(self, z: FloatArray, expect: Callable[[FloatArray], FloatArray]) -> tuple[FloatArray, FloatArray]:
        """Innovation (m,) of ``z`` and its covariance without noise (m, m), by the sigma points of the prior."""
        from filterpy.kalman import unscented_transform

        self.ukf.x, self.ukf.P = np.zeros(STATES), self.P
        self.ukf.sigmas_f = self.points.sigma_points(self.ukf.x, self.P)
        mean, covariance = unscented_transform(
            np.array([expect(dx) for dx in self.ukf.sigmas_f]), self.ukf.Wm, self.ukf.Wc
        )
        return z - mean, covariance

    def _update(self, update: int) -> None:
        """Adapt R and take position and velocity."""
        _, R, rows = self.updates.take(update, lambda z, rows: self._innovate(z, lambda dx: self._expect(dx)[rows]))
        if rows.size:
            z = self.timeline.measurements.z[update, rows]
            self._take_rows(z, R, lambda dx: self._expect(dx)[rows])

    def _take_rows(self, z: FloatArray, R: FloatArray, expect: Callable[[FloatArray], FloatArray]) -> None:
        """Update with rows that are there, from the sigma points of the prior."""
        self.ukf.update(z, R=R, hx=expect)
        self._recentre()

    def _take_alone(self, z: FloatArray, R: FloatArray, expect: Callable[[FloatArray], FloatArray]) -> None:
        """Take rows that no adaptation sees."""
        self._innovate(z, expect)
        self._take_rows(z, R, expect)

    def _take_heading(self, yaw_rad: float, sigma_rad: float) -> None:
        here, _ = heading(self.state)

        def turned(dx: FloatArray) -> FloatArray:
            """The heading of a sigma point, from that of the nominal state on."""
            return np.array([wrap_angle(np.array(heading(added(self.state, dx))[0] - here))])

        self._take_alone(wrap_angle(np.array([yaw_rad - here])), np.array([[sigma_rad**2]]), turned)

    def _constrain(self, sample: int) -> None:
        """Zero velocity when it stands still, else none sideways and upwards."""
        limits = self.settings.constraints
        slow = np.linalg.norm(self.state.velocity_mps) < limits.still_below_mps
        if limits.still[sample] and slow:
            sigma = limits.still_sigma_mps
            self._take_alone(np.zeros(3), sigma**2 * np.eye(3), lambda dx: self.state.velocity_mps + dx[V])
        elif limits.sideways_sigma_mps > 0:
            self._take_alone(np.zeros(2), limits.sideways_sigma_mps**2 * np.eye(2), self._sideways)

    def _sideways(self, dx: FloatArray) -> FloatArray:
        point_m = self.settings.constraints.sideways_point_m
        h, _ = velocity_in_body(added(self.state, dx), self.rate - dx[BG], point_m)
        return h[1:]
