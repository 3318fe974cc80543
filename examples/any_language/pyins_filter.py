"""pyins (python-ins 1.0.1) over a recording in its own tables: python pyins_filter.py FOLDER OUT.csv."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from pyins import measurements, strapdown
from pyins.filters import run_feedback_filter
from pyins.inertial_sensor import EstimationModel

GYRO = EstimationModel(bias_sd=0.01, noise=1e-3, bias_walk=1e-5)  # rad/s, rad/s/sqrt(Hz), rad/s/sqrt(s)
ACCEL = EstimationModel(bias_sd=0.1, noise=1e-2, bias_walk=1e-3)  # m/s2, likewise
NAMES = {"lat": "latitude_deg", "lon": "longitude_deg", "alt": "height_m"}
NAMES |= {"VN": "north_mps", "VE": "east_mps", "VD": "down_mps"}


def main(folder: Path, out: Path) -> None:
    """Run the feedback filter from the first fix on, and write what it estimates at every stamp of the IMU."""
    tables = {path.stem: pd.read_csv(path, index_col="time").dropna() for path in folder.glob("*.csv")}
    position, velocity, attitude = tables["position"], tables["velocity"], tables["attitude"]
    begin = max(position.index[0], velocity.index[0])
    imu = tables["imu"].loc[: tables["imu"].index[-1]]
    sums = imu.mul(np.diff(imu.index, prepend=2 * imu.index[0] - imu.index[1]), axis=0)  # over each interval
    increments = strapdown.compute_increments_from_imu(sums.loc[begin:], "increment")
    first = [table.loc[:begin].iloc[-1] for table in (position, velocity, attitude)]
    pva = pd.concat([row.drop("sd", errors="ignore") for row in first]).rename(begin)
    aiding = [
        measurements.Position(position.drop(columns="sd"), position["sd"].mean()),
        measurements.NedVelocity(velocity.drop(columns="sd"), velocity["sd"].mean()),
    ]
    deviations = (position["sd"].iloc[0], velocity["sd"].iloc[0], 1.0, 3.0)  # m, m/s, deg, deg
    result = run_feedback_filter(pva, *deviations, increments, GYRO, ACCEL, measurements=aiding)
    table = result.trajectory.rename(columns=NAMES).rename_axis("t_s")
    for angle, name in (("roll", "roll_rad"), ("pitch", "pitch_rad"), ("heading", "yaw_rad")):
        table[name] = np.radians(table.pop(angle))
    table.to_csv(out, float_format="%.12g")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
