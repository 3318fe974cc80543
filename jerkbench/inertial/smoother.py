"""The Rauch-Tung-Striebel smoother over the error state of an inertial navigation.

The forward pass stores a node for each time step that ends with a correction or at a time stamp of the reference. A
node contains the prior state x- and its covariance P-, the posterior state x+ and its covariance P+, and the transition
Phi from the previous node. The prior error has the mean zero, because every correction is applied to the nominal state
immediately. The backward pass starts at the last node. Let x (-) y be the error state that transforms y into x, and let
P' be the covariance of the smoothed error about x-. The backward pass computes the smoothed state xs and its covariance
Ps::

    G = P+ Phi' (P-_{k+1})^-1
    xs = x+ corrected by G (xs_{k+1} (-) x-_{k+1})
    Ps = P+ + G (P'_{k+1} - P-_{k+1}) G'
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.contracts import Adaptation
from jerkbench.estimate import Estimate
from jerkbench.geometry import euler_from_dcm
from jerkbench.inertial.run import InertialRun, state_at_point
from jerkbench.inertial.run_inputs import Events, InertialInputs
from jerkbench.inertial.state import PHI, NavigationState, corrected, error_between
from jerkbench.inertial.update import reset, transformed


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
    """Run the backward pass and return the smoothed solution at each node."""
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
