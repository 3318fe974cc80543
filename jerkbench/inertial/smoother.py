"""The Rauch-Tung-Striebel smoother over the error states of an inertial navigation.

Forward, a node for each step at which something is taken or given out: the prior x-, P- before what is taken, the
posterior x+, P+ after it (both nominal states with the covariance of their error), and Phi from the node before. The
error of the prior is zero, because every correction goes into the nominal state at once; so, backward from the last
node, with x (-) y the error state that takes y to x, and P' the smoothed covariance in the numbers of the prior::

    G = P+ Phi' (P-_{k+1})^-1
    xs = x+ with G (xs_{k+1} (-) x-_{k+1}) put into it
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
from jerkbench.inertial.run import InertialRun, InertialSolution, given_out
from jerkbench.inertial.run_inputs import Events, Journey
from jerkbench.inertial.state import PHI, NavigationState, corrected, error_between
from jerkbench.inertial.update import carried_over, reset


class Node(NamedTuple):
    """One step of the forward pass.

    Attributes:
        Phi: (n, n) from the posterior of the node before to the prior of this one.
        prior: nominal state before what is taken.
        P_prior: (n, n) covariance of its error.
        posterior: nominal state after it.
        P: (n, n) covariance of its error.
        rate_radps: (3,) the body's rate there.
        reference: row of the reference, or -1.
    """

    Phi: FloatArray
    prior: NavigationState
    P_prior: FloatArray
    posterior: NavigationState
    P: FloatArray
    rate_radps: FloatArray
    reference: int


class ForwardRun(InertialRun):
    """A run that remembers its nodes; its own estimate is that of the filter."""

    nodes: list[Node]
    Phi: FloatArray

    def over(self, events: Events) -> InertialSolution:
        """Go through ``events``, as the filter does."""
        self.nodes, self.Phi = [], np.eye(len(self.P))
        return super().over(events)

    def _grow(self, Phi: FloatArray, Q: FloatArray) -> None:
        super()._grow(Phi, Q)
        self.Phi = Phi @ self.Phi

    def _take(self, events: Events, at: int, *, constrained: bool) -> bool:
        prior, P_prior = self.state, self.P
        well = super()._take(events, at, constrained=constrained)
        if well:
            self._remember(prior, P_prior, -1)
        return well

    def _keep(self, reference: int) -> None:
        super()._keep(reference)
        if self.nodes and self.nodes[-1].posterior is self.state:
            self.nodes[-1] = self.nodes[-1]._replace(reference=reference)
        else:
            self._remember(self.state, self.P, reference)

    def _remember(self, prior: NavigationState, P_prior: FloatArray, reference: int) -> None:
        self.nodes.append(Node(self.Phi, prior, P_prior, self.state, self.P, self.rate, reference))
        self.Phi = np.eye(len(self.P))


class Smoothed(NamedTuple):
    """What all measurements say of a node.

    Attributes:
        state: nominal state.
        covariance: (n, n) of its error.
    """

    state: NavigationState
    covariance: FloatArray


def smooth_navigation(journey: Journey, adaptation: Adaptation) -> Estimate:
    """Return the smoothed solution at the reference's stamps; where the forward pass stops, up to there."""
    run = ForwardRun(journey, adaptation)
    estimate = run.over(journey.events).estimate
    smoothed = backward(run.nodes)
    kept = [(node, later) for node, later in zip(run.nodes, smoothed, strict=True) if node.reference >= 0]
    if not kept:
        return estimate
    point_m = journey.settings.reference_point_m
    shown = [given_out(later.state, later.covariance, node.rate_radps, point_m) for node, later in kept]
    x, P = np.array([x for x, _ in shown]), np.array([P for _, P in shown])
    euler_rad = euler_from_dcm(np.array([later.state.dcm for _, later in kept]))
    return replace(estimate, position_m=x[:, :3], velocity_mps=x[:, 3:], covariance=P, euler_rad=euler_rad)


def backward(nodes: Sequence[Node]) -> list[Smoothed]:
    """Return each of ``nodes`` as all measurements see it."""
    if not nodes:
        return []
    smoothed = [Smoothed(nodes[-1].posterior, nodes[-1].P)]
    for node, later in zip(nodes[-2::-1], nodes[:0:-1], strict=True):
        smoothed.append(_smoothed(node, later, smoothed[-1]))
    return smoothed[::-1]


def _smoothed(node: Node, later: Node, known: Smoothed) -> Smoothed:
    """Return ``node`` from ``later``, the node after it, of which all is ``known``."""
    G = gain(node.P, later.Phi, later.P_prior)
    error = error_between(known.state, later.prior)
    back = np.asarray(np.linalg.inv(reset(later.prior, known.state, error[PHI])), dtype=np.float64)
    change = carried_over(known.covariance, back) - later.P_prior
    dx = G @ error
    state = corrected(node.posterior, dx)
    onward = reset(node.posterior, state, dx[PHI])
    return Smoothed(state, carried_over(node.P + G @ change @ G.T, onward))


def gain(P: FloatArray, Phi: FloatArray, P_prior: FloatArray) -> FloatArray:
    """Return G (n, n) = P Phi' P_prior^-1, by sigmas of P_prior so that units do not spoil its inverse."""
    sigma = np.sqrt(np.diag(P_prior))
    solved = np.linalg.solve(P_prior / np.outer(sigma, sigma), (Phi @ P) / sigma[:, None])
    return np.asarray((solved / sigma[:, None]).T)
