"""A filter over position fixes whose motion model is a horizontal turn at a constant rate."""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Adaptation
from jerkbench.estimate import Attitude, Estimate
from jerkbench.filters.common import START, VELOCITY_WALK, AdaptedR, MeasurementUpdates
from jerkbench.kalman import is_healthy
from jerkbench.parameters import NOT_NEGATIVE, DefaultOrigin, Limited, Provenance, Range
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.timeline import Timeline, build_timeline

TURN_WALK = Range(1e-3, 1.0, log=True, source="ours: from a straight road to a robot that turns on the spot")
STRAIGHT_RAD = 1e-4
"""Below this turn angle of a step, a and b are computed from the first terms of their power series [rad]."""


@register("filter", "constant_turn")
@dataclass(frozen=True)
class ConstantTurn(Limited, AdaptedR):
    """Seven states [p, v, w]: a horizontal turn at the rate w with a constant vertical velocity, without the IMU.

    The following equations define one prediction step, with s = sin(w dt), c = cos(w dt), a = s/w and b = (1 - c)/w::

        e += a v_e - b v_n    v_e = c v_e - s v_n    u += dt v_u
        n += b v_e + a v_n    v_n = s v_e + c v_n

    The covariance is propagated with the Jacobian of this step (extended Kalman filter). On each axis, the process
    noise of position and velocity is the same as in `constant_velocity`. The process noise of the turn rate w has the
    variance q_w^2 dt. In a gap between position fixes, this filter predicts a circular arc, whereas `constant_velocity`
    predicts a straight line. The turn rate w is observable only through the position fixes, so the estimate of w is
    noisy if the fixes are noisy and the vehicle is slow.

    Source: the nearly coordinated turn model (Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking
    and Navigation", 11.7, doi:10.1002/0471221279).

    Attributes:
        velocity_walk_mps_per_sqrt_s: q, intensity of the random walk of the velocity [m/s/sqrt(s)].
        turn_walk_radps_per_sqrt_s: q_w, intensity of the random walk of the turn rate [rad/s/sqrt(s)].
        initial_turn_radps: standard deviation of the initial turn rate [rad/s].
    """

    provenance = Provenance("published", "doi:10.1002/0471221279")

    uses_imu: ClassVar[bool] = False

    velocity_walk_mps_per_sqrt_s: Annotated[
        float,
        VELOCITY_WALK,
        NOT_NEGATIVE,
        DefaultOrigin("the source's rule: a car that changes its velocity by 1 m/s within a second"),
    ] = 1.0
    turn_walk_radps_per_sqrt_s: Annotated[
        float,
        TURN_WALK,
        NOT_NEGATIVE,
        DefaultOrigin("ours: a vehicle that changes its turn rate by 3 deg/s within a second"),
    ] = 0.05
    initial_turn_radps: Annotated[float, START, NOT_NEGATIVE] = 0.1

    def estimate(self, recording: Recording, attitude: Attitude, adaptation: Adaptation) -> Estimate:
        """Return the estimate at the time stamps of the reference, up to a step at which P is not positive definite."""
        return self.filtered(build_timeline(recording, attitude), adaptation)

    def filtered(self, timeline: Timeline, adaptation: Adaptation) -> Estimate:
        """Run the filter over a timeline and return the estimate at the time stamps of the reference."""
        update = MeasurementUpdates(timeline, adaptation)
        x, P = self.start(timeline)
        for k, dt in enumerate(timeline.dt_s.tolist()):
            if dt > 0:
                x, P, _ = self.predicted(x, P, dt)
            row, reference = int(timeline.update[k]), int(timeline.reference[k])
            if row >= 0:
                x, P, _ = update(row, x, P)
            if not is_healthy(x[:6], P[:6, :6]):
                failure = f"the covariance is no longer positive definite at {timeline.t_s[k]:.2f} s"
                return update.recorder.estimate(failure)
            if reference >= 0:
                update.recorder.state(reference, x[:6], P[:6, :6])
        return update.recorder.estimate()

    def start(self, timeline: Timeline) -> tuple[FloatArray, FloatArray]:
        """Return the initial state x (7,) and its covariance P (7, 7) for a timeline."""
        P = np.zeros((7, 7))
        P[:6, :6], P[6, 6] = timeline.P0, self.initial_turn_radps**2
        return np.append(timeline.x0, 0.0), P

    def predicted(self, x: FloatArray, P: FloatArray, dt: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the predicted x (7,) and P (7, 7) after ``dt`` seconds, and the Jacobian F (7, 7) of the step."""
        F = turn_jacobian(x, dt)
        return after_turn(x, dt), F @ P @ F.T + self._noise(dt), F

    def _noise(self, dt: float) -> FloatArray:
        axis = self.velocity_walk_mps_per_sqrt_s**2 * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
        Q = np.zeros((7, 7))
        Q[:6, :6], Q[6, 6] = np.kron(axis, np.eye(3)), self.turn_walk_radps_per_sqrt_s**2 * dt
        return Q


def after_turn(x: FloatArray, dt: float) -> FloatArray:
    """Return the state (7,) after a horizontal turn of ``dt`` seconds that starts at the state x (7,)."""
    a, b, c, s, _, _ = _factors(x[6], dt)
    e, n, u, v_e, v_n, v_u, w = x
    return np.array(
        [e + a * v_e - b * v_n, n + b * v_e + a * v_n, u + dt * v_u, c * v_e - s * v_n, s * v_e + c * v_n, v_u, w]
    )


def turn_jacobian(x: FloatArray, dt: float) -> FloatArray:
    """Return the Jacobian (7, 7) of `after_turn` with respect to the state x (7,)."""
    a, b, c, s, da, db = _factors(x[6], dt)
    v_e, v_n = x[3:5]
    F = np.eye(7)
    F[:2, 3:5] = [[a, -b], [b, a]]
    F[2, 5] = dt
    F[3:5, 3:5] = [[c, -s], [s, c]]
    F[:2, 6] = [da * v_e - db * v_n, db * v_e + da * v_n]
    F[3:5, 6] = [-dt * (s * v_e + c * v_n), dt * (c * v_e - s * v_n)]
    return F


def _factors(w: float, dt: float) -> tuple[float, ...]:
    """Return a = sin(w dt)/w, b = (1 - cos(w dt))/w, cos(w dt), sin(w dt), da/dw and db/dw."""
    angle = w * dt
    c, s = float(np.cos(angle)), float(np.sin(angle))
    if abs(angle) < STRAIGHT_RAD:
        return dt * (1 - angle**2 / 6), dt * angle / 2, c, s, -dt * dt * angle / 3, dt * dt / 2
    a, b = s / w, (1 - c) / w
    return a, b, c, s, (dt * c - a) / w, (dt * s - b) / w
