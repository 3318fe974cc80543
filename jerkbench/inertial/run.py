"""One run of the error-state inertial navigation over the events of a recording."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from jerkbench.adapted_updates import AdaptedUpdates
from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.contracts import Adaptation
from jerkbench.estimate import Estimate
from jerkbench.geometry import euler_from_dcm
from jerkbench.inertial.mechanisation import advance_navigation, calibrated, propagated, step_noise, transition
from jerkbench.inertial.run_inputs import Events, Journey
from jerkbench.inertial.state import PHI, NavigationState, corrected, is_finite
from jerkbench.inertial.update import (
    carried_over,
    corrected_on_group,
    correction,
    heading,
    point_in_enu,
    reset,
    reset_on_group,
    velocity_in_body,
    wheel_speed,
)
from jerkbench.kalman import has_factor

STRETCH = 512
"""Most steps that are made at once: their Phi have to find room."""


class InertialSolution(NamedTuple):
    """What a run gives.

    Attributes:
        estimate: at the reference's stamps.
        state: nominal state at the end.
        covariance: (n, n) of its error.
    """

    estimate: Estimate
    state: NavigationState
    covariance: FloatArray


def given_out(
    state: NavigationState, covariance: FloatArray, rate_radps: FloatArray, point_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return position and velocity (6,) of a point of the body, and their covariance (6, 6)."""
    if not point_m.any():  # nearly always, and at every step where the reference is that dense
        return np.concatenate([state.position_m, state.velocity_mps]), covariance[:6, :6]
    x, H = point_in_enu(state, rate_radps, point_m)
    return x, H @ covariance @ H.T


class InertialRun:
    """The state of one run, and its steps."""

    def __init__(self, journey: Journey, adaptation: Adaptation) -> None:
        """Put a run together."""
        self.imu, self.timeline, self.headings, _, start, self.settings = journey
        self.state, self.P = start
        self.updates = AdaptedUpdates(journey.timeline, adaptation, log_det=False)
        self.noises: dict[int, FloatArray] = {}
        self.rate = np.zeros(3)
        self.dcms: list[FloatArray] = []

    def over(self, events: Events) -> InertialSolution:
        """Go through ``events``; stops at the first sign of divergence."""
        constrained = events.constrained & self._is_constrained(events.sample)
        corrects = (events.update >= 0) | (events.heading >= 0) | constrained
        is_end = np.arange(len(corrects)) % STRETCH == STRETCH - 1
        is_end[-1] = True
        begin = 0
        for last in np.flatnonzero(corrects | is_end).tolist():
            self._predict(events, begin, last)
            if corrects[last] and not self._take(events, last, constrained=bool(constrained[last])):
                return self._solution(f"the covariance is no longer positive definite at {events.t_s[last]:.2f} s")
            if events.reference[last] >= 0:
                self._keep(int(events.reference[last]))
            begin = last + 1
        return self._solution()

    def _predict(self, events: Events, begin: int, last: int) -> None:
        """Go through a stretch of steps at whose ends nothing is corrected but at the last one's.

        The nominal state does not depend on P, so all of its steps are made at once.
        """
        steps = slice(begin, last + 1)
        dt_s, samples = events.dt_s[steps], events.sample[steps]
        start = self.state
        sensed = calibrated(start, self.imu.accel_mps2[samples], self.imu.gyro_radps[samples])
        passage = advance_navigation(start, *sensed, dt_s, self.settings.earth)
        Phi = transition(dt_s, passage.mean_dcm, passage.force_enu_mps2, len(self.P))
        references = events.reference[steps].tolist()
        for k, dt in enumerate(dt_s.tolist()):
            self._grow(Phi[k], self._noise(dt))
            if k == len(dt_s) - 1 or references[k] >= 0:
                self.state, self.rate = passage.state(start, k), sensed[1][k]
            if k < len(dt_s) - 1 and references[k] >= 0:
                self._keep(references[k])

    def _grow(self, Phi: FloatArray, Q: FloatArray) -> None:
        """Carry the covariance over a step."""
        self.P = propagated(self.P, Phi, Q)

    def _noise(self, dt: float) -> FloatArray:
        """The process noise of a step of dt, made once for each whole nanosecond."""
        key = round(dt * 1e9)
        if key not in self.noises:
            self.noises[key] = step_noise(self.settings.noise, dt, len(self.P))
        return self.noises[key]

    def _is_constrained(self, sample: IntArray) -> BoolArray:
        """Whether there is any constraint at those samples of the IMU."""
        limits = self.settings.constraints
        return np.asarray(limits.still[sample] | (limits.sideways_sigma_mps > 0))

    def _take(self, events: Events, at: int, *, constrained: bool) -> bool:
        """Take what comes at the end of a step; whether the filter is well after it."""
        update, row = int(events.update[at]), int(events.heading[at])
        if update >= 0:
            self._update(update)
        if row >= 0 and self.headings is not None:
            self._take_heading(float(self.headings.yaw_rad[row]), float(self.headings.sigma_rad[row]))
        if constrained:
            self._constrain(int(events.sample[at]))
        return is_finite(self.state) and has_factor(self.P)

    def _update(self, update: int) -> None:
        """Adapt R and take position and velocity."""
        h, H = self._expected()
        y, R, rows = self.updates.take(update, lambda z, rows: (z - h[rows], H[rows] @ self.P @ H[rows].T))
        if rows.size:
            self._correct(y, H[rows], R)

    def _expected(self) -> tuple[FloatArray, FloatArray]:
        """The six rows of position and velocity that the state expects, and their H."""
        h, H = point_in_enu(self.state, self.rate, self.settings.antenna_m)
        if self.settings.velocity_frame == "body":
            h[3:], H[3:] = velocity_in_body(self.state, self.rate, np.zeros(3))
        elif self.settings.velocity_frame == "speed":
            h[3:], H[3:] = wheel_speed(self.state, self.rate, self.settings.wheel_m)
        return h, H

    def _take_heading(self, yaw_rad: float, sigma_rad: float) -> None:
        expected, H = heading(self.state)
        innovation = np.remainder(yaw_rad - expected + np.pi, 2.0 * np.pi) - np.pi
        self._correct(np.array([innovation]), H, np.array([[sigma_rad**2]]))

    def _constrain(self, sample: int) -> None:
        """Zero velocity when it stands still, else none sideways and upwards."""
        limits = self.settings.constraints
        slow = np.linalg.norm(self.state.velocity_mps) < limits.still_below_mps
        if limits.still[sample] and slow:
            h, H = point_in_enu(self.state, self.rate, np.zeros(3))
            self._correct(-h[3:], H[3:], limits.still_sigma_mps**2 * np.eye(3))
        elif limits.sideways_sigma_mps > 0:
            h, H = velocity_in_body(self.state, self.rate, limits.sideways_point_m)
            self._correct(-h[1:], H[1:], limits.sideways_sigma_mps**2 * np.eye(2))

    def _correct(self, innovation: FloatArray, H: FloatArray, R: FloatArray) -> None:
        """Update with rows that are there."""
        before = self.state
        dx, self.P = correction(self.P, innovation, H, R)
        if self.settings.invariant:
            self.state = corrected_on_group(before, dx)
            G = reset_on_group(before, self.state)
        else:
            self.state = corrected(before, dx)
            G = reset(before, self.state, dx[PHI])
        self.P = carried_over(self.P, G)

    def _keep(self, reference: int) -> None:
        """Keep position and velocity of the reference point, and the attitude."""
        self.updates.recorder.state(
            reference, *given_out(self.state, self.P, self.rate, self.settings.reference_point_m)
        )
        self.dcms.append(self.state.dcm)

    def _solution(self, failure: str = "") -> InertialSolution:
        estimate = self.updates.recorder.estimate(failure)
        euler_rad = euler_from_dcm(np.array(self.dcms)) if self.dcms else np.empty((0, 3))
        return InertialSolution(replace(estimate, euler_rad=euler_rad), self.state, self.P)
