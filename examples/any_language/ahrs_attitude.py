"""A filter of the package ahrs: python ahrs_attitude.py recording.csv OUT.csv [filter=NAME] [NAME=VALUE ...].

The filter is Madgwick (default), Mahony, EKF or another class of ahrs.filters that takes ``gyr``, ``acc`` and
``frequency``. Each other NAME=VALUE is a parameter of this class, for example gain=0.033.
"""

import sys

import ahrs
import numpy as np
import pandas as pd

GYRO = [f"gyro_{axis}_radps" for axis in ("forward", "left", "up")]
ACCEL = [f"accel_{axis}_mps2" for axis in ("forward", "left", "up")]


def level(force: np.ndarray) -> np.ndarray:
    """Return the quaternion of a body at rest with this specific force (3,) and the heading 0."""
    roll, pitch = np.arctan2(force[1], force[2]) / 2, np.arctan2(-force[0], np.hypot(force[1], force[2])) / 2
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    return np.array([cr * cp, sr * cp, cr * sp, -sr * sp])


def quaternions(imu: pd.DataFrame, filter: str = "Madgwick", **parameters: float) -> np.ndarray:  # noqa: A002
    """Return the quaternion (n, 4) after each sample, body to a frame whose z is up, from the mean force of 1 s."""
    rate_hz = 1.0 / float(np.median(np.diff(imu["t_s"])))
    gyro, accel = (imu[names].to_numpy(dtype=float) for names in (GYRO, ACCEL))
    start = level(accel[: round(rate_hz)].mean(axis=0))
    return getattr(ahrs.filters, filter)(gyr=gyro, acc=accel, frequency=rate_hz, q0=start, **parameters).Q


if __name__ == "__main__":
    given = dict(argument.split("=") for argument in sys.argv[3:])
    name = given.pop("filter", "Madgwick")
    samples = pd.read_csv(sys.argv[1])[["t_s", *GYRO, *ACCEL]].dropna()
    found = quaternions(samples, name, **{key: float(value) for key, value in given.items()})
    table = pd.DataFrame(found, columns=["qw", "qx", "qy", "qz"])
    table.insert(0, "t_s", samples["t_s"].to_numpy())
    table.to_csv(sys.argv[2], index=False)
