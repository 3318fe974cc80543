"""A factor graph on GTSAM, solved by iSAM2: python gtsam_isam2.py recording.csv OUT.csv [NAME=VALUE ...].

Each NAME=VALUE changes one of the SETTINGS, for example accel_density=0.002. A node with pose, velocity and biases is
added at each fix and velocity. After the update the latest node is propagated with the IMU until the next node, so
that an estimate uses only earlier measurements.
"""

import sys
from pathlib import Path

import gtsam
import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

GRAVITY_MPS2 = 9.81
SETTINGS = {
    "gyro_density": 1.7e-4,  # rad/s/sqrt(Hz), white noise of the gyro
    "accel_density": 2e-3,  # m/s2/sqrt(Hz), white noise of the accelerometer
    "gyro_walk": 1e-6,  # rad/s2/sqrt(Hz), random walk of the gyro bias
    "accel_walk": 5e-5,  # m/s3/sqrt(Hz), random walk of the accelerometer bias
    "gyro_bias": 2.5e-3,  # rad/s, standard deviation of the initial bias
    "accel_bias": 0.1,  # m/s2
    "tilt": 0.02,  # rad, standard deviation of the initial roll and pitch
    "yaw": 0.05,  # rad
    "position": 1.0,  # factor on the covariance of fixes
    "velocity": 1.0,  # factor on the covariance of velocities
    "huber": 0.0,  # threshold of Huber's loss in standard deviations; 0 for least squares
    "cauchy": 0.0,  # scale of Cauchy's loss in standard deviations; 0 for least squares
}
IMU = [
    f"{kind}_{axis}_{unit}"
    for kind, unit in (("gyro", "radps"), ("accel", "mps2"))
    for axis in ("forward", "left", "up")
]
AXES = ("east", "north", "up")
ANGLES = ["attitude_yaw_rad", "attitude_pitch_rad", "attitude_roll_rad"]


class Noise:
    """The noise models of fixes and velocities.

    Args:
        use: The values of SETTINGS.
    """

    def __init__(self, use: dict[str, float]) -> None:
        self.factors = {"position": use["position"], "velocity": use["velocity"]}
        losses, self.loss = gtsam.noiseModel.mEstimator, None
        for name, kind in (("huber", losses.Huber), ("cauchy", losses.Cauchy)):
            if use[name]:
                self.loss = kind.Create(use[name])

    def model(self, stream: str, variances: np.ndarray) -> gtsam.noiseModel.Base:
        """Return the model of a measurement with these variances (3,)."""
        model = gtsam.noiseModel.Diagonal.Variances(self.factors[stream] * variances)
        return gtsam.noiseModel.Robust.Create(self.loss, model) if self.loss else model


def parameters(use: dict[str, float]) -> gtsam.PreintegrationCombinedParams:
    """Return the noise of the IMU in the form of GTSAM."""
    params = gtsam.PreintegrationCombinedParams.MakeSharedU(GRAVITY_MPS2)
    params.setGyroscopeCovariance(use["gyro_density"] ** 2 * np.eye(3))
    params.setAccelerometerCovariance(use["accel_density"] ** 2 * np.eye(3))
    params.setIntegrationCovariance(1e-10 * np.eye(3))
    params.setBiasOmegaCovariance(use["gyro_walk"] ** 2 * np.eye(3))
    params.setBiasAccCovariance(use["accel_walk"] ** 2 * np.eye(3))
    return params


def first_node(
    graph: gtsam.NonlinearFactorGraph, values: gtsam.Values, state: gtsam.NavState, use: dict[str, float]
) -> None:
    """Add the first node and its priors. The tilt and the yaw have different standard deviations, in ENU axes."""
    turn = state.attitude().matrix()
    covariance = np.diag([0.0] * 3 + [100.0] * 3)
    covariance[:3, :3] = turn.T @ np.diag([use["tilt"] ** 2, use["tilt"] ** 2, use["yaw"] ** 2]) @ turn
    graph.add(gtsam.PriorFactorPose3(0, state.pose(), gtsam.noiseModel.Gaussian.Covariance(covariance)))
    graph.add(gtsam.PriorFactorVector(1, state.velocity(), gtsam.noiseModel.Isotropic.Sigma(3, 10.0)))
    sigmas = gtsam.noiseModel.Diagonal.Sigmas(np.repeat([use["accel_bias"], use["gyro_bias"]], 3))
    graph.add(gtsam.PriorFactorConstantBias(2, gtsam.imuBias.ConstantBias(), sigmas))
    values.insert(0, state.pose())
    values.insert(1, state.velocity())
    values.insert(2, gtsam.imuBias.ConstantBias())


def main(recording: Path, out: Path, **changed: float) -> None:
    """Write the estimate at each sample of the IMU from the first fix on."""
    use = SETTINGS | changed
    table = pd.read_csv(recording).dropna(subset=IMU).reset_index(drop=True)
    t_s, imu = table["t_s"].to_numpy(), table[IMU].to_numpy()
    dt = np.diff(t_s, prepend=t_s[0] - np.median(np.diff(t_s)))
    measured, variances = {}, {}
    for stream, unit, square in (("position", "m", "m2"), ("velocity", "mps", "m2ps2")):
        measured[stream] = table[[f"{stream}_{axis}_{unit}" for axis in AXES]].to_numpy()
        variances[stream] = table[[f"{stream}_variance_{k}{k}_{square}" for k in (1, 2, 3)]].to_numpy()
    known = {stream: np.isfinite(values).all(axis=1) for stream, values in measured.items()}
    # A sample is the mean over the interval that ends at its stamp: the force is rotated to the middle of it.
    turned = Rotation.from_rotvec(imu[:, :3] * dt[:, None]).apply(imu[:, 3:])
    force = 0.5 * (imu[:, 3:] + turned)

    begin = int(np.flatnonzero(known["position"])[0])
    start = gtsam.Rot3(Rotation.from_euler("ZYX", table.loc[begin, ANGLES]).as_matrix())
    speed = measured["velocity"][begin] if known["velocity"][begin] else np.zeros(3)
    state, bias = gtsam.NavState(start, measured["position"][begin], speed), gtsam.imuBias.ConstantBias()
    between, noise = gtsam.PreintegratedCombinedMeasurements(parameters(use), bias), Noise(use)
    settings = gtsam.ISAM2Params()
    settings.setRelinearizeThreshold(0.01)
    settings.relinearizeSkip = 1
    settings.setFactorization("QR")  # with Cholesky, GTSAM reports an indeterminate system at some nodes
    isam, node, rows = gtsam.ISAM2(settings), 0, []
    for k in range(begin, len(t_s)):
        if k > begin:
            between.integrateMeasurement(force[k], imu[k, :3], dt[k])
        predicted = between.predict(state, bias) if k > begin else state
        if known["position"][k] or known["velocity"][k]:
            graph, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
            x, v, b = 3 * node, 3 * node + 1, 3 * node + 2
            if node == 0:
                first_node(graph, values, state, use)
            else:
                graph.add(gtsam.CombinedImuFactor(x - 3, v - 3, x, v, b - 3, b, between))
                values.insert(x, predicted.pose())
                values.insert(v, predicted.velocity())
                values.insert(b, bias)
            if known["position"][k]:
                model = noise.model("position", variances["position"][k])
                graph.add(gtsam.GPSFactor(x, measured["position"][k], model))
            if known["velocity"][k]:
                model = noise.model("velocity", variances["velocity"][k])
                graph.add(gtsam.PriorFactorVector(v, measured["velocity"][k], model))
            isam.update(graph, values)
            pose, speed = isam.calculateEstimatePose3(x), isam.calculateEstimateVector(v)
            bias = isam.calculateEstimateConstantBias(b)
            state = predicted = gtsam.NavState(pose, speed)
            between, node = gtsam.PreintegratedCombinedMeasurements(parameters(use), bias), node + 1
        rows.append([t_s[k], *predicted.position(), *predicted.velocity(), *predicted.attitude().rpy()])
    names = [
        "t_s",
        *(f"{axis}_m" for axis in AXES),
        *(f"{axis}_mps" for axis in AXES),
        "roll_rad",
        "pitch_rad",
        "yaw_rad",
    ]
    pd.DataFrame(rows, columns=names).to_csv(out, index=False, float_format="%.12g")


if __name__ == "__main__":
    given = dict(argument.split("=") for argument in sys.argv[3:])
    main(Path(sys.argv[1]), Path(sys.argv[2]), **{name: float(value) for name, value in given.items()})
