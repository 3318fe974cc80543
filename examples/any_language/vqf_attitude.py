"""The attitude filter VQF (package vqf): python vqf_attitude.py recording.csv OUT.csv [NAME=VALUE ...].

Each NAME=VALUE is a parameter of vqf.VQF, for example tauAcc=3.
"""

import sys

import numpy as np
import pandas as pd
import vqf

GYRO = [f"gyro_{axis}_radps" for axis in ("forward", "left", "up")]
ACCEL = [f"accel_{axis}_mps2" for axis in ("forward", "left", "up")]


def quaternions(imu: pd.DataFrame, **parameters: float) -> np.ndarray:
    """Return the quaternion (n, 4) after each sample, body to a frame whose z is up."""
    switches = {name: bool(value) for name, value in parameters.items() if name.endswith("Enabled")}
    filter_ = vqf.VQF(float(np.median(np.diff(imu["t_s"]))), **(parameters | switches))
    gyro, accel = (np.ascontiguousarray(imu[names].to_numpy(dtype=float)) for names in (GYRO, ACCEL))
    return filter_.updateBatch(gyro, accel)["quat6D"]


if __name__ == "__main__":
    given = dict(argument.split("=") for argument in sys.argv[3:])
    samples = pd.read_csv(sys.argv[1])[["t_s", *GYRO, *ACCEL]].dropna()
    found = quaternions(samples, **{name: float(value) for name, value in given.items()})
    table = pd.DataFrame(found, columns=["qw", "qx", "qy", "qz"])
    table.insert(0, "t_s", samples["t_s"].to_numpy())
    table.to_csv(sys.argv[2], index=False)
