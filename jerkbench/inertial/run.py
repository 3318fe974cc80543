"""The reference implementation of the error-state inertial navigation and of its smoother in NumPy."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Adaptation
from jerkbench.estimate import Estimate
from jerkbench.geometry import euler_from_dcm
from jerkbench.inertial.run_inputs import Events, InertialInputs
from jerkbench.inertial.state import (
    PHI,
    NavigationState,
    advance_navigation,
    calibrated,
    corrected,
    error_between,
    process_noise,
    transition,
)
from jerkbench.inertial.update import (
    corrected_on_group,
    correction,
    heading,
    point_in_enu,
    reset,
    reset_on_group,
    transformed,
    velocity_in_body,
    wheel_speed,
)
from jerkbench.kalman import has_factor
from jerkbench.numpy_run import AdaptedUpdates

MAX_STEPS = 512
"""Maximum number of steps that are propagated together. This limits the memory for the matrices Phi."""


class InertialSolution(NamedTuple):
    """The result of a run of an inertial filter.

    Attributes:
        estimate: estimate at the time stamps of the reference.
        state: nominal state at the end of the run.
        covariance: (n, n) covariance of the error of ``state``.
    """

    estimate: Estimate
    state: NavigationState
    covariance: FloatArray


def state_at_point(
    state: NavigationState, covariance: FloatArray, rate_radps: FloatArray, point_m: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return position and velocity (6,) in ENU of a point of the body, and their covariance (6, 6)."""
    x, H = point_in_enu(state, rate_radps, point_m)
    return x, H @ covariance @ H.T


class InertialRun:
    """One run of an inertial filter, with its current state and covariance and the stored results."""

    def __init__(self, inputs: InertialInputs, adaptation: Adaptation) -> None:
        self.inputs = inputs
        self.imu, self.timeline, self.headings, _, start, self.settings = inputs
        self.state, self.P = start
        self.updates = AdaptedUpdates(inputs.timeline, adaptation, log_det=False)
        self.rate = np.zeros(3)
        self.dcms: list[FloatArray] = []

    def solve(self) -> InertialSolution:
        """Process all time steps of the run. The run ends early if the covariance is no longer positive definite."""
        events, constrained = self.inputs.events, self.inputs.is_constrained
        corrects = (events.update >= 0) | (events.heading >= 0) | constrained
        is_end = np.arange(len(corrects)) % MAX_STEPS == MAX_STEPS - 1
        is_end[-1] = True
        start = 0
        for last in np.flatnonzero(corrects | is_end).tolist():
            self._predict(events, start, last)
            if corrects[last] and not self._apply_corrections(events, last, constrained=bool(constrained[last])):
                return self._solution(f"the covariance is no longer positive definite at {events.t_s[last]:.2f} s")
            if events.reference[last] >= 0:
                self._store(int(events.reference[last]))
            start = last + 1
        return self._solution()

    def _predict(self, events: Events, start: int, last: int) -> None:
        """Propagate the state and its covariance over the steps ``start`` to ``last``.

        Only the last step may end with a correction. The nominal state does not depend on P, so the nominal state is
        propagated over all steps before P is propagated.
        """
        steps = slice(start, last + 1)
        dt_s, samples, before = events.dt_s[steps], events.sample[steps], self.state
        sensed = calibrated(before, self.imu.accel_mps2[samples], self.imu.gyro_radps[samples])
        propagation = advance_navigation(before, *sensed, dt_s, self.settings.earth)
        Phi = transition(dt_s, propagation.mean_dcm, propagation.force_enu_mps2, len(self.P))
        references = events.reference[steps].tolist()
        for k, dt in enumerate(dt_s.tolist()):
            self._propagate_covariance(Phi[k], process_noise(self.settings.noise, dt, len(self.P)))
            if k == len(dt_s) - 1 or references[k] >= 0:
                self.state, self.rate = propagation.state(before, k), sensed[1][k]
            if k < len(dt_s) - 1 and references[k] >= 0:
                self._store(references[k])

    def _propagate_covariance(self, Phi: FloatArray, Q: FloatArray) -> None:
        self.P = np.asarray(Phi.dot(self.P).dot(Phi.T) + Q)

    def _apply_corrections(self, events: Events, k: int, *, constrained: bool) -> bool:
        """Apply the measurements and constraints after step ``k``. Return False if the filter has diverged."""
        update, row = int(events.update[k]), int(events.heading[k])
        if update >= 0:
            self._update(update)
        if row >= 0 and self.headings is not None:
            self._update_heading(float(self.headings.yaw_rad[row]), float(self.headings.sigma_rad[row]))
        if constrained:
            self._constrain(int(events.sample[k]))
        finite = all(bool(np.isfinite(part).all()) for part in self.state[:5])  # wheel_scale is finite if these are
        return finite and has_factor(self.P)

    def _update(self, update: int) -> None:
        """Update the state with row ``update`` of the measured positions and velocities, and with the adapted R."""
        h, H = self._predict_measurement(self.state, self.rate)
        y, R, rows = self.updates.take(update, lambda z, rows: (z - h[rows], H[rows] @ self.P @ H[rows].T))
        if rows.size:
            self._correct(y, H[rows], R)

    def _predict_measurement(self, state: NavigationState, rate_radps: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the predicted measurement (6,) of position and velocity, and its Jacobian H (6, n)."""
        h, H = point_in_enu(state, rate_radps, self.settings.antenna_m)
        if self.settings.velocity_frame == "body":
            h[3:], H[3:] = velocity_in_body(state, rate_radps, np.zeros(3))
        elif self.settings.velocity_frame == "speed":
            h[3:], H[3:] = wheel_speed(state, rate_radps, self.settings.constraints.sideways_point_m)
        return h, H

    def _update_heading(self, yaw_rad: float, sigma_rad: float) -> None:
        predicted, H = heading(self.state)
        innovation = np.remainder(yaw_rad - predicted + np.pi, 2.0 * np.pi) - np.pi
        self._correct(np.array([innovation]), H, np.array([[sigma_rad**2]]))

    def _constrain(self, sample: int) -> None:
        """Apply a zero-velocity update if the vehicle is stationary, otherwise the non-holonomic constraint."""
        limits = self.settings.constraints
        if limits.still[sample] and np.linalg.norm(self.state.velocity_mps) < limits.still_below_mps:
            h, H = point_in_enu(self.state, self.rate, np.zeros(3))
            self._correct(-h[3:], H[3:], limits.still_sigma_mps**2 * np.eye(3))
        elif limits.sideways_sigma_mps > 0:
            h, H = velocity_in_body(self.state, self.rate, limits.sideways_point_m)
            self._correct(-h[1:], H[1:], limits.sideways_sigma_mps**2 * np.eye(2))

    def _correct(self, innovation: FloatArray, H: FloatArray, R: FloatArray) -> None:
        before = self.state
        dx, self.P = correction(self.P, innovation, H, R)
        if self.settings.invariant:
            self.state = corrected_on_group(before, dx)
            G = reset_on_group(before, self.state)
        else:
            self.state = corrected(before, dx)
            G = reset(before, self.state, dx[PHI])
        self.P = transformed(self.P, G)

    def _store(self, reference: int) -> None:
        """Store the attitude, and position and velocity of the reference point, for the time stamp ``reference``."""
        x, P = state_at_point(self.state, self.P, self.rate, self.settings.reference_point_m)
        self.updates.recorder.state(reference, x, P)
        self.dcms.append(self.state.dcm)

    def _solution(self, failure: str = "") -> InertialSolution:
        estimate = self.updates.recorder.estimate(failure)
        euler_rad = euler_from_dcm(np.array(self.dcms)) if self.dcms else np.empty((0, 3))
        return InertialSolution(replace(estimate, euler_rad=euler_rad), self.state, self.P)


# The Rauch-Tung-Striebel smoother over the error state.


class Node(NamedTuple):
    """The prior and posterior state of the filter at one node of the forward pass.

    Attributes:
        Phi: (n, n) transition from the posterior of the previous node to the prior of this node.
        prior: nominal state before the correction at this node.
        P_prior: (n, n) covariance of the error of ``prior``.
        posterior: nominal state after the correction at this node.
        P: (n, n) covariance of the error of ``posterior``.
        rate_radps: (3,) angular rate of the body, from which the gyro bias is subtracted [rad/s].
        reference: row of the reference at this node, or -1 if the reference has no time stamp there.
    """

    Phi: FloatArray
    prior: NavigationState
    P_prior: FloatArray
    posterior: NavigationState
    P: FloatArray
    rate_radps: FloatArray
    reference: int


class ForwardRun(InertialRun):
    """A run of the inertial filter that stores the nodes for the backward pass of the smoother."""

    def __init__(self, inputs: InertialInputs, adaptation: Adaptation) -> None:
        super().__init__(inputs, adaptation)
        self.nodes: list[Node] = []
        self.Phi = np.eye(len(self.P))

    def _propagate_covariance(self, Phi: FloatArray, Q: FloatArray) -> None:
        super()._propagate_covariance(Phi, Q)
        self.Phi = Phi @ self.Phi

    def _apply_corrections(self, events: Events, k: int, *, constrained: bool) -> bool:
        prior, P_prior = self.state, self.P
        healthy = super()._apply_corrections(events, k, constrained=constrained)
        if healthy:
            self._add_node(prior, P_prior, -1)
        return healthy

    def _store(self, reference: int) -> None:
        super()._store(reference)
        if self.nodes and self.nodes[-1].posterior is self.state:
            self.nodes[-1] = self.nodes[-1]._replace(reference=reference)
        else:
            self._add_node(self.state, self.P, reference)

    def _add_node(self, prior: NavigationState, P_prior: FloatArray, reference: int) -> None:
        self.nodes.append(Node(self.Phi, prior, P_prior, self.state, self.P, self.rate, reference))
        self.Phi = np.eye(len(self.P))


class Smoothed(NamedTuple):
    """The smoothed solution at one node.

    Attributes:
        state: smoothed nominal state.
        covariance: (n, n) covariance of the error of ``state``.
    """

    state: NavigationState
    covariance: FloatArray


def smooth_navigation(inputs: InertialInputs, adaptation: Adaptation) -> Estimate:
    """Return the smoothed estimate at the time stamps of the reference, up to a divergence of the forward pass."""
    run = ForwardRun(inputs, adaptation)
    estimate = run.solve().estimate
    pairs = zip(run.nodes, smooth_backward(run.nodes), strict=True)
    outputs = [(node, smoothed) for node, smoothed in pairs if node.reference >= 0]
    if not outputs:
        return estimate
    point_m = inputs.settings.reference_point_m
    points = [state_at_point(*smoothed, node.rate_radps, point_m) for node, smoothed in outputs]
    x, P = np.array([x for x, _ in points]), np.array([P for _, P in points])
    euler_rad = euler_from_dcm(np.array([smoothed.state.dcm for _, smoothed in outputs]))
    return replace(estimate, position_m=x[:, :3], velocity_mps=x[:, 3:], covariance=P, euler_rad=euler_rad)


def smooth_backward(nodes: Sequence[Node]) -> list[Smoothed]:
    """Run the backward pass and return the smoothed solution at each node.

    Each time step that ends with a correction or at a time stamp of the reference has a node. A node contains the prior
    state x- and its covariance P-, the posterior state x+ and its covariance P+, and the transition Phi from the
    previous node. The prior error has the mean zero, because every correction is applied to the nominal state
    immediately. The backward pass starts at the last node. Let x (-) y be the error state that transforms y into x, and
    let P' be the covariance of the smoothed error about x-. The backward pass computes the smoothed state xs and its
    covariance Ps::

        G = P+ Phi' (P-_{k+1})^-1
        xs = x+ corrected by G (xs_{k+1} (-) x-_{k+1})
        Ps = P+ + G (P'_{k+1} - P-_{k+1}) G'
    """
    if not nodes:
        return []
    smoothed = [Smoothed(nodes[-1].posterior, nodes[-1].P)]
    for node, following in zip(nodes[-2::-1], nodes[:0:-1], strict=True):
        later = smoothed[-1]
        error = error_between(later.state, following.prior)
        inverse_reset = np.asarray(np.linalg.inv(reset(following.prior, later.state, error[PHI])), dtype=np.float64)
        change = transformed(later.covariance, inverse_reset) - following.P_prior
        G = _smoother_gain(node.P, following.Phi, following.P_prior)
        dx = G @ error
        state = corrected(node.posterior, dx)
        P = transformed(node.P + G @ change @ G.T, reset(node.posterior, state, dx[PHI]))
        smoothed.append(Smoothed(state, P))
    return smoothed[::-1]


def _smoother_gain(P: FloatArray, Phi: FloatArray, P_prior: FloatArray) -> FloatArray:
    """Return the smoother gain G (n, n) = P Phi' P_prior^-1.

    P_prior is scaled to a unit diagonal, which improves the condition of the linear system.
    """
    sigma = np.sqrt(np.diag(P_prior))
    solved = np.linalg.solve(P_prior / np.outer(sigma, sigma), (Phi @ P) / sigma[:, None])
    return np.asarray((solved / sigma[:, None]).T)
