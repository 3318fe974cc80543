"""The solution of a factor graph of an inertial navigation, over the whole drive or over its last seconds."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.estimate import Estimate, Updates
from jerkbench.geometry import euler_from_dcm
from jerkbench.inertial.factor_graph import Graph, Known, to_eskf
from jerkbench.inertial.mechanisation import FLAT, advance_navigation, calibrated, propagated, step_noise, transition
from jerkbench.inertial.run_inputs import Journey
from jerkbench.inertial.state import STATES, NavigationState

AGAIN = 2
"""How often a node with a lag is solved again about its solution."""


def batch(graph: Graph, initial: Callable[[int], NavigationState]) -> Iterator[Known]:
    """Yield every node as the whole drive knows it, from the states of ``initial`` on."""
    factors, values = graph.start()
    for node in range(1, len(graph.nodes)):
        graph.insert(values, node, initial(node))
        graph.moved(factors, node, initial(node - 1))
        graph.measure(factors, values, node)
    params = graph.gtsam.LevenbergMarquardtParams()
    params.setMaxIterations(graph.options.iterations)
    params.setRelativeErrorTol(1e-10)
    solved = graph.gtsam.LevenbergMarquardtOptimizer(factors, values, params).optimize()
    marginals = graph.gtsam.Marginals(factors, solved)
    for node in range(len(graph.nodes)):
        yield graph.known(marginals, solved, node)


def fixed_lag(graph: Graph) -> Iterator[Known]:
    """Yield every node as the seconds before it know it: older ones are marginalised."""
    params = graph.gtsam.ISAM2Params()
    params.setFactorization("QR")
    params.setRelinearizeThreshold(0.0)  # all of what is kept, each time
    params.relinearizeSkip = 1
    smoother = graph.gtsam.IncrementalFixedLagSmoother(graph.options.lag_s, params)
    t_s, state = graph.journey.events.t_s, graph.journey.start[0]
    for node, k in enumerate(graph.nodes):
        factors, values = graph.gtsam.NonlinearFactorGraph(), graph.gtsam.Values()
        if node == 0:
            factors, values = graph.start()
        else:
            graph.moved(factors, node, state)
            graph.measure(factors, values, node)
            graph.insert(values, node, carried(graph.journey, (state, np.eye(STATES)), graph.nodes[node - 1], k)[0])
        smoother.update(factors, values, dict.fromkeys(values.keys(), float(t_s[k])))
        for _ in range(AGAIN):
            smoother.update()
        solved = smoother.calculateEstimate()
        state = graph.state(solved, node)
        yield state, newest_covariance(smoother.getFactors().linearize(solved), state)


def newest_covariance(linear: Any, state: NavigationState) -> FloatArray:  # noqa: ANN401 - it has no types
    """Return the covariance (15, 15) of the newest node, whose keys are the last, as eskf15 has it.

    By the triangular factor of all columns, each scaled to one: GTSAM's own marginals fail on a few nodes.
    """
    A, _ = linear.jacobian()
    scale = np.linalg.norm(A, axis=0)
    scaled = A / scale
    corner = np.linalg.cholesky(scaled.T @ scaled)[-STATES:, -STATES:].T * scale[-STATES:]
    root = to_eskf(state.dcm) @ np.linalg.inv(corner)
    return np.asarray(root @ root.T, dtype=np.float64)


def carried(journey: Journey, known: Known, begin: int, end: int) -> Known:
    """Return what is ``known`` after step ``begin`` as it is after step ``end``, by eskf15's mechanisation."""
    (state, covariance), steps = known, slice(begin + 1, end + 1)
    dt_s, samples = journey.events.dt_s[steps], journey.events.sample[steps]
    if not len(dt_s):
        return known
    sensed = calibrated(state, journey.imu.accel_mps2[samples], journey.imu.gyro_radps[samples])
    passage = advance_navigation(state, *sensed, dt_s, FLAT)
    for dt, Phi in zip(dt_s, transition(dt_s, passage.mean_dcm, passage.force_enu_mps2), strict=True):
        covariance = propagated(covariance, Phi, step_noise(journey.settings.noise, float(dt)))
    return passage.state(state, len(dt_s) - 1), covariance


def estimate_of(journey: Journey, nodes: list[int], known: list[Known]) -> Estimate:
    """Return the solution at the reference's stamps, each carried on from the node before it."""
    steps = np.flatnonzero(journey.events.reference >= 0)
    states, at = [], 0
    here, begin = known[0], nodes[0]
    for step in steps.tolist():
        if at + 1 < len(nodes) and nodes[at + 1] <= step:
            at = int(np.searchsorted(nodes, step, side="right")) - 1
            here, begin = known[at], nodes[at]
        here, begin = carried(journey, here, begin, step), step
        states.append(here)
    covariance = np.array([P15[:6, :6] for _, P15 in states])
    euler_rad = euler_from_dcm(np.array([state.dcm for state, _ in states]))
    places = np.array([state.position_m for state, _ in states]), np.array([state.velocity_mps for state, _ in states])
    return Estimate(journey.events.reference[steps], *places, covariance, euler_rad, Updates.empty())
