"""A factor graph on GTSAM for jerkbench: inertial navigation, smoothed over the complete recording."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from jerkbench.estimate import Estimate

GRAVITY_MPS2 = 9.81


@dataclass(frozen=True)
class GtsamGraph:
    """Estimates pose, velocity and biases at every fix and velocity by one least-squares problem.

    The graph minimises, with r whitened residuals::

        |r_start|^2/2 + sum |r_imu|^2/2 + sum rho(|r_fix|) + sum rho(|r_velocity|)
        none    rho = r^2/2
        huber   rho = r^2/2 up to k, k (r - k/2) beyond
        cauchy  rho = k^2/2 log(1 + r^2/k^2)

    r_imu is GTSAM's CombinedImuFactor: all IMU samples between two nodes, preintegrated, with a random walk of the
    biases. The first attitude is that of the attitude filter. The optimiser is Levenberg-Marquardt. Between two nodes
    the estimate is the prediction from the node before, with the covariance of that node.

    It is a smoother, so that it cannot be used while driving. It needs fixes of all three axes and, if there is a
    velocity, one in ENU. It ignores lever arms and headings.

    Source: C. Forster, L. Carlone, F. Dellaert, D. Scaramuzza, "On-manifold preintegration for real-time
    visual-inertial odometry", IEEE Transactions on Robotics 33(1), 2017, doi:10.1109/TRO.2016.2597321.

    Attributes:
        loss: rho of fixes and velocities: none, huber or cauchy.
        loss_scale: k, in sigmas of all three axes together [-].
        gyro_density: white noise of the gyro [rad/s/sqrt(Hz)].
        accel_density: white noise of the accelerometer [m/s2/sqrt(Hz)].
        gyro_walk: random walk of the gyro's bias [rad/s2/sqrt(Hz)].
        accel_walk: random walk of the accelerometer's bias [m/s3/sqrt(Hz)].
        gyro_bias_radps: one sigma of the gyro's bias at the start [rad/s].
        accel_bias_mps2: one sigma of the accelerometer's bias at the start [m/s2].
        tilt_sigma_rad: one sigma of roll and pitch at the start [rad].
        yaw_sigma_rad: one sigma of yaw at the start, if the attitude filter states none [rad].
    """

    adaptations = ("none",)

    loss: str = "none"
    loss_scale: float = 1.345
    gyro_density: float = 1.7e-4
    accel_density: float = 2e-3
    gyro_walk: float = 1e-6
    accel_walk: float = 5e-5
    gyro_bias_radps: float = 2.5e-3
    accel_bias_mps2: float = 0.1
    tilt_sigma_rad: float = 0.02
    yaw_sigma_rad: float = 0.05

    def estimate(self, recording, attitude, adaptation):
        """Return the solution at the reference's stamps from the first fix on."""
        import gtsam  # it takes a second

        velocity = recording.velocity
        if velocity is not None and velocity.frame != "enu":
            raise ValueError(f"gtsam_graph needs a velocity in ENU, and this one is in the frame '{velocity.frame}'.")
        fixes, speeds = _complete(recording.position, "enu_m"), _complete(velocity, "mps")
        end_s = recording.inertial.t_s[-1]
        times_s = np.unique([t for t in (*fixes, *speeds) if min(fixes) <= t <= end_s])
        params = self._params(gtsam)
        graph, values = self._start(gtsam, recording, attitude, times_s[0], fixes, speeds)
        state = gtsam.NavState(values.atPose3(0), values.atVector(1))
        for node, t in enumerate(times_s):
            x, v, b = 3 * node, 3 * node + 1, 3 * node + 2
            if node:
                between = _integrated(gtsam, params, recording.inertial, times_s[node - 1], t)
                graph.add(gtsam.CombinedImuFactor(x - 3, v - 3, x, v, b - 3, b, between))
                state = between.predict(state, gtsam.imuBias.ConstantBias())
                values.insert(x, state.pose())
                values.insert(v, state.velocity())
                values.insert(b, gtsam.imuBias.ConstantBias())
            if t in fixes:
                graph.add(gtsam.GPSFactor(x, fixes[t][0], self._noise(gtsam, fixes[t][1])))
                state = gtsam.NavState(gtsam.Pose3(state.pose().rotation(), fixes[t][0]), state.velocity())
            if t in speeds:
                graph.add(gtsam.PriorFactorVector(v, speeds[t][0], self._noise(gtsam, speeds[t][1])))
        solved = gtsam.LevenbergMarquardtOptimizer(graph, values).optimize()
        return _at_reference(gtsam, recording, params, times_s, graph, solved)

    def _params(self, gtsam):
        params = gtsam.PreintegrationCombinedParams.MakeSharedU(GRAVITY_MPS2)
        params.setGyroscopeCovariance(self.gyro_density**2 * np.eye(3))
        params.setAccelerometerCovariance(self.accel_density**2 * np.eye(3))
        params.setIntegrationCovariance(1e-10 * np.eye(3))
        params.setBiasOmegaCovariance(self.gyro_walk**2 * np.eye(3))
        params.setBiasAccCovariance(self.accel_walk**2 * np.eye(3))
        return params

    def _start(self, gtsam, recording, attitude, t_s, fixes, speeds):
        """Return the graph with the priors of the first node, and its values."""
        graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        sample = max(np.searchsorted(recording.inertial.t_s, t_s, side="right") - 1, 0)
        pose = gtsam.Pose3(gtsam.Rot3(attitude.dcm[sample]), fixes[t_s][0])
        yaw = self.yaw_sigma_rad if attitude.yaw_sigma_rad is None else attitude.yaw_sigma_rad[sample]
        in_enu = np.diag([self.tilt_sigma_rad, self.tilt_sigma_rad, max(yaw, self.yaw_sigma_rad)]) ** 2
        covariance = np.diag([0.0] * 3 + [100.0] * 3)  # the fix says where it is
        covariance[:3, :3] = attitude.dcm[sample].T @ in_enu @ attitude.dcm[sample]
        graph.add(gtsam.PriorFactorPose3(0, pose, gtsam.noiseModel.Gaussian.Covariance(covariance)))
        sigmas = np.repeat([self.accel_bias_mps2, self.gyro_bias_radps], 3)
        bias = gtsam.imuBias.ConstantBias()
        graph.add(gtsam.PriorFactorConstantBias(2, bias, gtsam.noiseModel.Diagonal.Sigmas(sigmas)))
        first = speeds[min(speeds)][0] if speeds else np.zeros(3)
        graph.add(gtsam.PriorFactorVector(1, first, gtsam.noiseModel.Isotropic.Sigma(3, 10.0)))
        for key, value in enumerate((pose, first, bias)):
            values.insert(key, value)
        return graph, values

    def _noise(self, gtsam, covariance):
        models = gtsam.noiseModel
        noise = models.Gaussian.Covariance(covariance)
        if self.loss == "none":
            return noise
        losses = {"huber": models.mEstimator.Huber, "cauchy": models.mEstimator.Cauchy}
        if self.loss not in losses:
            raise ValueError(f"loss is '{self.loss}'; give none, huber or cauchy.")
        return models.Robust.Create(losses[self.loss].Create(self.loss_scale), noise)


def _complete(stream, name):
    """Return value and covariance by time, of measurements of all three axes."""
    if stream is None:
        return {}
    covariance = getattr(stream, {"enu_m": "covariance_m2", "mps": "covariance_m2ps2"}[name])
    rows = zip(stream.t_s.tolist(), getattr(stream, name), covariance, strict=True)
    return {round(t, 9): (np.array(value), np.array(R)) for t, value, R in rows if np.isfinite(value).all()}


def _integrated(gtsam, params, imu, begin_s, end_s):
    """Preintegrate the samples between two times. A sample is the mean over the interval that ends at its stamp."""
    found = gtsam.PreintegratedCombinedMeasurements(params, gtsam.imuBias.ConstantBias())
    first = np.searchsorted(imu.t_s, begin_s, side="right")
    for k in range(first, len(imu.t_s)):
        dt = min(imu.t_s[k], end_s) - max(imu.t_s[k - 1] if k else begin_s, begin_s)
        if dt > 0.0:
            force, turn = imu.accel_mps2[k], Rotation.from_rotvec(imu.gyro_radps[k] * dt).as_matrix()
            found.integrateMeasurement(0.5 * (force + turn @ force), imu.gyro_radps[k], dt)
        if imu.t_s[k] >= end_s:
            break
    return found


def _at_reference(gtsam, recording, params, times_s, graph, solved):
    """Return the estimate: every stamp of the reference is predicted from the node before it."""
    stamps_s, marginals = recording.reference.t_s, gtsam.Marginals(graph, solved)
    index = np.flatnonzero((stamps_s >= times_s[0]) & (stamps_s <= recording.inertial.t_s[-1]))
    nodes = np.searchsorted(times_s, stamps_s[index], side="right") - 1
    covariances, positions, velocities, turns = {}, [], [], []
    for t, node in zip(stamps_s[index], nodes.tolist(), strict=True):
        pose, velocity, bias = (
            solved.atPose3(3 * node),
            solved.atVector(3 * node + 1),
            solved.atConstantBias(3 * node + 2),
        )
        if node not in covariances:
            covariances[node] = _in_enu(marginals, pose, node)
        state = gtsam.NavState(pose, velocity)
        if t > times_s[node]:
            state = _integrated(gtsam, params, recording.inertial, times_s[node], t).predict(state, bias)
        positions.append(state.position())
        velocities.append(state.velocity())
        turns.append(state.attitude().matrix())
    euler_rad = Rotation.from_matrix(np.array(turns)).as_euler("ZYX")[:, ::-1]
    P = np.array([covariances[node] for node in nodes.tolist()])
    return Estimate(index, np.array(positions), np.array(velocities), P, euler_rad)


def _in_enu(marginals, pose, node):
    """Return the covariance (6, 6) of position and velocity in ENU. GTSAM's position errors are those of the body."""
    keys = [3 * node, 3 * node + 1, 3 * node + 2]  # with the biases: without them GTSAM finds some nodes indeterminate
    joint = marginals.jointMarginalCovariance(keys)
    P = np.block([[joint.at(a, b) for b in keys[:2]] for a in keys[:2]])[3:, 3:]
    T = np.eye(6)
    T[:3, :3] = pose.rotation().matrix()
    return T @ P @ T.T
