"""An attitude program inside the filter ``baseline``: python attitude_baseline.py SCRIPT recording.csv OUT.csv [...].

SCRIPT is a Python program that writes quaternions (docs/attitude_filter.md). It receives the samples of the IMU only.
Its tilt and the measured headings give the attitude, from which follows the acceleration without gravity. This is the
input of the Kalman filter. NAME=VALUE with a name in SETTINGS changes the Kalman filter, for example accel_mps2=1.37.
All other arguments are those of SCRIPT.
"""

import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

GRAVITY_MPS2 = 9.81
SETTINGS = {
    "accel_mps2": 0.2,  # m/s2, standard deviation of one sample of the acceleration
    "position": 1.0,  # factor on the covariance of fixes
    "velocity": 1.0,  # factor on the covariance of velocities
    "yaw_walk": 2e-4,  # rad/sqrt(s), random walk of the difference between heading and yaw of the attitude program
}
IMU = [
    f"{kind}_{axis}_{unit}"
    for kind, unit in (("gyro", "radps"), ("accel", "mps2"))
    for axis in ("forward", "left", "up")
]
AXES = ("east", "north", "up")


def acceleration(table: pd.DataFrame, quaternion: np.ndarray, yaw_walk: float) -> np.ndarray:
    """Return the acceleration without gravity (n, 3) in ENU, the mean over the interval that ends at each sample."""
    turns = Rotation.from_quat(quaternion, scalar_first=True)
    yaw = turns.as_euler("ZYX")[:, 0]
    heading, sigma = table["heading_yaw_rad"].to_numpy(), table["heading_sigma_rad"].to_numpy()
    dt = np.diff(table["t_s"], prepend=table["t_s"].iloc[0])
    first = np.flatnonzero(np.isfinite(heading))[0]
    offset, variance, offsets = heading[first] - yaw[first], sigma[first] ** 2, np.empty(len(yaw))
    for k in range(len(yaw)):
        variance += yaw_walk**2 * dt[k]
        if k > first and np.isfinite(heading[k]):
            gain = variance / (variance + sigma[k] ** 2)
            offset += gain * np.angle(np.exp(1j * (heading[k] - yaw[k] - offset)))
            variance *= 1.0 - gain
        offsets[k] = offset
    dcm = (Rotation.from_euler("Z", offsets[:, None]) * turns).as_matrix()
    middle = np.concatenate([dcm[:1], 0.5 * (dcm[1:] + dcm[:-1])])
    return np.einsum("nij,nj->ni", middle, table[IMU[3:]].to_numpy()) - [0.0, 0.0, GRAVITY_MPS2]


def navigate(table: pd.DataFrame, u: np.ndarray, accel_mps2: float, position: float, velocity: float) -> pd.DataFrame:
    """Return the estimate of the Kalman filter ``baseline``: position and velocity of each axis, with the input u."""
    z, R = (np.stack(arrays, axis=1) for arrays in (
        [table[[f"position_{axis}_m" for axis in AXES]], table[[f"velocity_{axis}_mps" for axis in AXES]]],
        [
            position * table[[f"position_variance_{k}{k}_m2" for k in (1, 2, 3)]],
            velocity * table[[f"velocity_variance_{k}{k}_m2ps2" for k in (1, 2, 3)]],
        ],
    ))  # fmt: skip
    measured = np.isfinite(z)
    begin = int(np.flatnonzero(measured.all(axis=(1, 2)))[0])
    dt = np.diff(table["t_s"], prepend=0.0)
    x, P = z[begin].copy(), np.zeros((2, 2, 3))
    P[0, 0], P[1, 1] = R[begin]
    rows = np.empty((len(table) - begin, 6))
    for k in range(begin, len(table)):
        if k > begin:
            b = 0.5 * dt[k] ** 2, dt[k]
            x = np.stack([x[0] + x[1] * dt[k] + b[0] * u[k], x[1] + b[1] * u[k]])
            P[0, 0] += dt[k] * (2.0 * P[0, 1] + dt[k] * P[1, 1])
            P[0, 1] += dt[k] * P[1, 1]
            P[0, 0] += (accel_mps2 * b[0]) ** 2
            P[0, 1] += accel_mps2**2 * b[0] * b[1]
            P[1, 1] += (accel_mps2 * b[1]) ** 2
            P[1, 0] = P[0, 1]
            for m in np.flatnonzero(measured[k].any(axis=1)):
                axes = measured[k, m]
                S = P[m, m] + R[k, m]
                K = np.where(axes, P[:, m] / S, 0.0)
                innovation = np.where(axes, z[k, m] - x[m], 0.0)
                x = x + K * innovation
                P = P - np.where(axes, S, 0.0) * K[:, None] * K[None, :]
        rows[k - begin] = *x[0], *x[1]
    estimate = pd.DataFrame(rows, columns=[f"{axis}_{unit}" for unit in ("m", "mps") for axis in AXES])
    estimate.insert(0, "t_s", table["t_s"].to_numpy()[begin:])
    return estimate


def main(script: str, recording: Path, out: Path, *arguments: str) -> None:
    """Run the attitude program and the Kalman filter, and write the estimate at each sample of the IMU."""
    given = dict(argument.split("=") for argument in arguments if argument.split("=")[0] in SETTINGS)
    use = SETTINGS | {name: float(value) for name, value in given.items()}
    table = pd.read_csv(recording).dropna(subset=IMU)
    rest = [argument for argument in arguments if argument.split("=")[0] not in SETTINGS]
    with TemporaryDirectory() as folder:
        samples, quaternions = Path(folder) / "recording.csv", Path(folder) / "quaternions.csv"
        table[["t_s", *IMU]].to_csv(samples, index=False)
        subprocess.run([sys.executable, script, samples, quaternions, *rest], check=True)  # noqa: S603
        quaternion = pd.read_csv(quaternions)[["qw", "qx", "qy", "qz"]].to_numpy()
    u = acceleration(table, quaternion, use.pop("yaw_walk"))
    navigate(table, u, **use).to_csv(out, index=False, float_format="%.12g")


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), Path(sys.argv[3]), *sys.argv[4:])
