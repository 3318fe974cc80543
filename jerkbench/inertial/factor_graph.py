"""The factor graph of an inertial navigation: its factors, and how it is put together."""

import importlib
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import PluginError
from jerkbench.estimate import Estimate, Updates
from jerkbench.geometry import euler_from_dcm, wrap_angle
from jerkbench.inertial.mechanisation import FLAT, advance_navigation, calibrated, propagated, step_noise, transition
from jerkbench.inertial.run_inputs import Journey
from jerkbench.inertial.state import BA, BG, PHI, STATES, NavigationState, P, V, rotation_exp, skew
from jerkbench.inertial.update import yaw_of
from jerkbench.recording import GRAVITY_MPS2

# Factors that GTSAM's Python has not: a measurement with a switch, and a heading, each as its CustomFactor.
#
# GTSAM's errors of a pose are those of the body, [w, s]: R Exp(w) and t + R s.

Expected = Callable[[Any], tuple[FloatArray, FloatArray]]
"""From values: what a measurement (m,) is expected to be, and the Jacobian (m, d) of its state."""


def expected_antenna(pose: int, antenna_m: FloatArray) -> Expected:
    """Expect the antenna's place t + R l of the pose with this key."""
    arm = skew(antenna_m)

    def expected(values: Any) -> tuple[FloatArray, FloatArray]:  # noqa: ANN401 - GTSAM has no types
        """Return the place (3,) [m] and its Jacobian (3, 6)."""
        at = values.atPose3(pose)
        dcm = at.rotation().matrix()
        return at.translation() + dcm @ antenna_m, np.hstack([-dcm @ arm, dcm])

    return expected


def expected_velocity(velocity: int) -> Expected:
    """Expect the velocity with this key."""
    return lambda values: (values.atVector(velocity), np.eye(3))


def switched(gtsam: Any, state: int, switch: int, expected: Expected, z: FloatArray, noise: Any) -> Any:  # noqa: ANN401
    """Return the factor with the residual s (h(x) - z): ``switch`` is the key of s, ``state`` that of x."""

    def residual(_: Any, values: Any, jacobians: list[FloatArray] | None) -> FloatArray:  # noqa: ANN401
        """Return s (h(x) - z) (m,), and fill in the Jacobians in the state and in s."""
        s, (h, H) = float(values.atVector(switch)[0]), expected(values)
        if jacobians is not None:
            jacobians[0], jacobians[1] = s * H, (h - z)[:, None]
        return s * (h - z)

    return gtsam.CustomFactor(noise, [state, switch], residual)


def measured_heading(gtsam: Any, pose: int, yaw_rad: float, sigma_rad: float) -> Any:  # noqa: ANN401
    """Return the factor of a heading of the pose with this key."""

    def residual(_: Any, values: Any, jacobians: list[FloatArray] | None) -> FloatArray:  # noqa: ANN401
        """Return the difference (1,) [rad], and fill in the Jacobian in the pose."""
        dcm = values.atPose3(pose).rotation().matrix()
        h, H = yaw_of(dcm)
        if jacobians is not None:
            jacobians[0] = np.concatenate([H @ dcm, np.zeros(3)])[None, :]
        return np.array([wrap_angle(np.array(h - yaw_rad))])

    return gtsam.CustomFactor(gtsam.noiseModel.Isotropic.Sigma(1, sigma_rad), [pose], residual)


# The factors of an inertial navigation on GTSAM, node by node; `batch` and `fixed_lag` solve them.
#
# A node for the start and for each time of a measurement: pose X, velocity V, biases B. Between two nodes stands
# GTSAM's CombinedImuFactor, of the samples between them preintegrated; at a node a GPSFactor and a prior of V, or the
# same with a switch each, and a heading. The start is one factor of X, V and B together, with every correlation that
# the levelling left.
#
# GTSAM's errors are those of the body, R Exp(w) and t + R s; with C the attitude they are eskf15's by phi = C w and
# dp = C s.

INTEGRATION = 1e-10
"""Variance of the integration of a position [m2/s]: GTSAM asks for one above 0."""

Known = tuple[NavigationState, FloatArray]
"""A nominal state, and the covariance (15, 15) of its error as eskf15 has it."""


class Options(NamedTuple):
    """What a graph is made of besides the journey.

    Attributes:
        loss: "none", "huber", "cauchy" or "switchable", of fixes and velocities.
        loss_scale: where it begins, in sigmas; of a switch 1/sigma.
        lag_s: how much of the drive is kept; 0: all of it.
        iterations: most that the batch makes.
    """

    loss: str
    loss_scale: float
    lag_s: float
    iterations: int


def require_gtsam() -> Any:  # noqa: ANN401 - it has no types
    """Return the package gtsam.

    Raises:
        PluginError: it is not installed.
    """
    try:
        return importlib.import_module("gtsam")
    except ModuleNotFoundError as error:
        raise PluginError("filter=fgo needs the package gtsam: pip install 'jerkbench[fgo]'.") from error


def keys(node: int) -> tuple[int, int, int]:
    """X, V and B of a node: after its switches, so that the newest node's are the last."""
    return 5 * node + 2, 5 * node + 3, 5 * node + 4


def switches(node: int) -> tuple[int, int]:
    """The switch of a node's fix and that of its velocity."""
    return 5 * node, 5 * node + 1


class Graph:
    """The factors of one journey, node by node."""

    def __init__(self, journey: Journey, options: Options) -> None:
        """Take the samples and what is known of the sensors."""
        self.gtsam, self.journey, self.options = require_gtsam(), journey, options
        noise, I3 = journey.settings.noise, np.eye(3)
        params = self.gtsam.PreintegrationCombinedParams.MakeSharedU(GRAVITY_MPS2)
        params.setGyroscopeCovariance(noise.angle * I3)
        params.setAccelerometerCovariance(noise.velocity * I3)
        params.setIntegrationCovariance(INTEGRATION * I3)
        params.setBiasOmegaCovariance(max(noise.gyro_bias, 1e-18) * I3)
        params.setBiasAccCovariance(max(noise.accel_bias, 1e-18) * I3)
        self.params = params
        events = journey.events
        measured = (events.update >= 0) | (events.heading >= 0)
        self.nodes = [0, *(k for k in np.flatnonzero(measured).tolist() if k > 0)]

    def bias(self, state: NavigationState) -> Any:  # noqa: ANN401 - as above
        """GTSAM's biases of a state."""
        return self.gtsam.imuBias.ConstantBias(state.accel_bias_mps2, state.gyro_bias_radps)

    def start(self) -> tuple[Any, Any]:
        """Factors and values of the first node."""
        graph, values, (state, covariance) = self.gtsam.NonlinearFactorGraph(), self.gtsam.Values(), self.journey.start
        self.insert(values, 0, state)
        root = np.linalg.inv(np.linalg.cholesky(covariance)) @ to_eskf(state.dcm)
        x, v, b = keys(0)
        unit = self.gtsam.noiseModel.Unit.Create(STATES)
        blocks = x, root[:, :6], v, root[:, 6:9], b, root[:, 9:]
        linear = self.gtsam.JacobianFactor(*blocks, np.zeros(STATES), unit)
        graph.push_back(self.gtsam.LinearContainerFactor(linear, values))
        self.measure(graph, values, 0)
        return graph, values

    def insert(self, values: Any, node: int, state: NavigationState) -> None:  # noqa: ANN401 - as above
        """Put a state into values."""
        x, v, b = keys(node)
        values.insert(x, self.gtsam.Pose3(self.gtsam.Rot3(state.dcm), state.position_m))
        values.insert(v, state.velocity_mps)
        values.insert(b, self.bias(state))

    def moved(self, graph: Any, node: int, begin: NavigationState) -> None:  # noqa: ANN401 - as above
        """Add the factor of the samples between ``node`` - 1 and ``node``.

        GTSAM takes a force with the attitude at the begin of a sample; ours is the mean over the sample, and goes in
        as (I + Exp(w dt))/2 f, with which both are the same.
        """
        events, imu = self.journey.events, self.journey.imu
        between = self.gtsam.PreintegratedCombinedMeasurements(self.params, self.bias(begin))
        steps = slice(self.nodes[node - 1] + 1, self.nodes[node] + 1)
        dt_s, sample = events.dt_s[steps], events.sample[steps]
        force, rate = calibrated(begin, imu.accel_mps2[sample], imu.gyro_radps[sample])
        turned = (rotation_exp(rate * dt_s[:, None]) @ force[:, :, None])[:, :, 0]
        shown = begin.accel_bias_mps2 + 0.5 * (force + turned)
        for accel, gyro, dt in zip(shown, imu.gyro_radps[sample], dt_s.tolist(), strict=True):
            if dt > 0.0:
                between.integrateMeasurement(accel, gyro, dt)
        (x, v, b), (y, w, c) = keys(node - 1), keys(node)
        graph.push_back(self.gtsam.CombinedImuFactor(x, v, y, w, b, c, between))

    def measure(self, graph: Any, values: Any, node: int) -> None:  # noqa: ANN401 - as above
        """Add what was measured at a node; its switches go into ``values``."""
        events, headings = self.journey.events, self.journey.headings
        row, heading = (int(rows[self.nodes[node]]) for rows in (events.update, events.heading))
        if row >= 0:
            self.fix(graph, values, node, row)
        if headings is not None and heading >= 0:
            yaw = float(headings.yaw_rad[heading]), float(headings.sigma_rad[heading])
            graph.push_back(measured_heading(self.gtsam, keys(node)[0], *yaw))

    def fix(self, graph: Any, values: Any, node: int, row: int) -> None:  # noqa: ANN401 - as above
        """Add position and velocity of a row, each where all of its axes are there."""
        measured, arm, (x, v, _) = self.journey.timeline.measurements, self.journey.settings.antenna_m, keys(node)
        z, R = measured.z[row], measured.R[row]
        place, pace = np.isfinite(z[:3]).all(), np.isfinite(z[3:]).all()
        if self.options.loss == "switchable":
            own = switches(node)
            if place:
                self.switch(graph, values, (x, own[0]), expected_antenna(x, arm), z[:3], R[:3, :3])
            if pace:
                self.switch(graph, values, (v, own[1]), expected_velocity(v), z[3:], R[3:, 3:])
            return
        if place:
            graph.push_back(self.gtsam.GPSFactorArm(x, z[:3], arm, self.noise(R[:3, :3])))
        if pace:
            graph.push_back(self.gtsam.PriorFactorVector(v, z[3:], self.noise(R[3:, 3:])))

    def switch(
        self,
        graph: Any,  # noqa: ANN401 - as above
        values: Any,  # noqa: ANN401 - as above
        keys: tuple[int, int],
        expected: Expected,
        z: FloatArray,
        R: FloatArray,
    ) -> None:
        """Add a measurement with a switch, and what draws the switch to 1."""
        switched_on, models = np.ones(1), self.gtsam.noiseModel
        graph.push_back(switched(self.gtsam, *keys, expected, z, models.Gaussian.Covariance(R)))
        sigma = models.Isotropic.Sigma(1, 1.0 / self.options.loss_scale)
        graph.push_back(self.gtsam.PriorFactorVector(keys[1], switched_on, sigma))
        values.insert(keys[1], switched_on)

    def noise(self, R: FloatArray) -> Any:  # noqa: ANN401 - as above
        """GTSAM's noise of a covariance (3, 3), with the loss."""
        models, loss = self.gtsam.noiseModel, self.options.loss
        gaussian = models.Gaussian.Covariance(R)
        if loss == "none":
            return gaussian
        kind = models.mEstimator.Huber if loss == "huber" else models.mEstimator.Cauchy
        return models.Robust.Create(kind.Create(self.options.loss_scale), gaussian)

    def state(self, values: Any, node: int) -> NavigationState:  # noqa: ANN401 - as above
        """A node's state of values."""
        x, v, b = keys(node)
        pose, bias = values.atPose3(x), values.atConstantBias(b)
        turn, place = pose.rotation().matrix(), np.array(pose.translation())
        return NavigationState(place, np.array(values.atVector(v)), turn, bias.gyroscope(), bias.accelerometer())

    def known(self, marginals: Any, values: Any, node: int) -> Known:  # noqa: ANN401 - as above
        """A node's state, and the covariance of its error as eskf15 has it."""
        state, own = self.state(values, node), keys(node)
        joint = marginals.jointMarginalCovariance(list(own))
        covariance = np.block([[joint.at(a, b) for b in own] for a in own])
        T = to_eskf(state.dcm)
        return state, T @ covariance @ T.T


def to_eskf(dcm: FloatArray) -> FloatArray:
    """T (15, 15) from GTSAM's errors [w, s, dv, db_a, db_g] to eskf15's [dp, dv, phi, db_g, db_a]."""
    T = np.zeros((STATES, STATES))
    T[P, 3:6], T[V, 6:9], T[PHI, 0:3] = dcm, np.eye(3), dcm
    T[BG, 12:15], T[BA, 9:12] = np.eye(3), np.eye(3)
    return T


# The solution of a factor graph of an inertial navigation, over the whole drive or over its last seconds.


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
