"""pyins (python-ins 1.0.1) over a recording: python pyins_filter.py recording.csv OUT.csv [NAME=VALUE ...].

Each NAME=VALUE changes one of the SETTINGS, for example gyro_noise=2e-4.
"""

import json
import os
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from pymap3d import enu2geodetic
from scipy.spatial.transform import Rotation

os.environ.setdefault(
    "NUMBA_DISABLE_JIT", "1"
)  # pyins compiles its loops in each process, which takes longer than a run
from pyins import measurements, strapdown
from pyins.filters import run_feedback_filter
from pyins.inertial_sensor import EstimationModel

SETTINGS = {
    "gyro_bias": 0.01,  # rad/s, standard deviation of the initial bias
    "gyro_noise": 1e-3,  # rad/s/sqrt(Hz)
    "gyro_walk": 1e-5,  # rad/s/sqrt(s)
    "accel_bias": 0.1,  # m/s2
    "accel_noise": 1e-2,  # m/s2/sqrt(Hz)
    "accel_walk": 1e-3,  # m/s2/sqrt(s)
    "position": 1.0,  # factor on the covariance of fixes
    "velocity": 1.0,  # factor on the covariance of velocities
    "time_step": 0.1,  # s, step of the covariance
}
NAMES = {"lat": "latitude_deg", "lon": "longitude_deg", "alt": "height_m"}
SD = ["sd_north", "sd_east", "sd_down"]
NAMES |= {"VN": "north_mps", "VE": "east_mps", "VD": "down_mps"}
FRD = np.array([1.0, -1.0, -1.0])  # signs that turn forward, left, up into forward, right, down


def tables_of(recording: Path) -> dict[str, pd.DataFrame]:
    """Return imu, position, velocity and attitude with the names of pyins, in NED, FRD and degrees.

    The columns ``sd_north``, ``sd_east`` and ``sd_down`` contain the reported standard deviations.
    """
    table = pd.read_csv(recording, index_col="t_s").rename_axis("time")
    origin = json.loads(recording.with_suffix(".json").read_text(encoding="utf-8"))["origin"]

    def columns(stream: str, names: str) -> pd.DataFrame:
        return table[[f"{stream}_{name}" for name in names.split()]].dropna()

    def frame(source: pd.DataFrame, names: str, values: np.ndarray, variances: str = "") -> pd.DataFrame:
        made = pd.DataFrame(np.asarray(values), source.index, names.split())
        if variances:
            made[SD] = np.sqrt(table.loc[source.index, variances.split()].to_numpy())
        return made

    axes = "forward_{0} left_{0} up_{0}"
    imu = pd.concat([columns("gyro", axes.format("radps")), columns("accel", axes.format("mps2"))], axis=1)
    fixes, velocity = columns("position", "east_m north_m up_m"), columns("velocity", "north_mps east_mps up_mps")
    attitude = columns("attitude", "yaw_rad pitch_rad roll_rad")
    ned_from_enu = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    turns = ned_from_enu @ Rotation.from_euler("ZYX", attitude).as_matrix() * FRD
    angles = Rotation.from_matrix(turns).as_euler("ZYX", degrees=True)[:, ::-1]
    places = np.column_stack(enu2geodetic(*fixes.to_numpy().T, *origin.values()))
    of_fixes, of_velocity = (
        " ".join(f"{stream}_variance_{axis}{axis}_{unit}" for axis in "213")
        for stream, unit in (("position", "m2"), ("velocity", "m2ps2"))
    )
    return {
        "imu": frame(imu, "gyro_x gyro_y gyro_z accel_x accel_y accel_z", imu * np.tile(FRD, 2)),
        "position": frame(fixes, "lat lon alt", places, of_fixes),
        "velocity": frame(velocity, "VN VE VD", velocity * [1.0, 1.0, -1.0], of_velocity),
        "attitude": frame(attitude, "roll pitch heading", angles),
    }


def grouped(kind: type, table: pd.DataFrame, factor: float) -> list[measurements.Measurement]:
    """Return an object for each R, because all measurements of an object have the same R.

    The standard deviations are rounded to two digits. The three axes need an array; the documentation has a float.
    """
    digits = 10 ** (np.floor(np.log10(table[SD])) - 1)
    rounded = [column for _, column in (np.rint(table[SD] / digits) * digits).round(9).items()]
    return [kind(rows.drop(columns=SD), np.sqrt(factor) * np.array(sd)) for sd, rows in table.groupby(rounded)]


def main(recording: Path, out: Path, **changed: float) -> None:
    """Run the feedback filter from the first fix on, and write what it estimates at every stamp of the IMU."""
    use, tables = SETTINGS | changed, tables_of(recording)
    position, velocity, attitude = tables["position"], tables["velocity"], tables["attitude"]
    begin = max(position.index[0], velocity.index[0])
    imu = tables["imu"].loc[: tables["imu"].index[-1]]
    sums = imu.mul(np.diff(imu.index, prepend=2 * imu.index[0] - imu.index[1]), axis=0)  # over each interval
    increments = strapdown.compute_increments_from_imu(sums.loc[begin:], "increment")
    first = [table.loc[:begin].iloc[-1] for table in (position, velocity, attitude)]
    pva = pd.concat([row.drop(SD, errors="ignore") for row in first]).rename(begin)
    aiding = [
        *grouped(measurements.Position, position, use["position"]),
        *grouped(measurements.NedVelocity, velocity, use["velocity"]),
    ]
    deviations = (position[SD].iloc[0].mean(), velocity[SD].iloc[0].mean(), 1.0, 3.0)  # m, m/s, deg, deg
    models = [
        EstimationModel(use[f"{sensor}_bias"], use[f"{sensor}_noise"], use[f"{sensor}_walk"])
        for sensor in ("gyro", "accel")
    ]
    result = run_feedback_filter(pva, *deviations, increments, *models, measurements=aiding, time_step=use["time_step"])
    table = result.trajectory.rename(columns=NAMES).rename_axis("t_s")
    for angle, name in (("roll", "roll_rad"), ("pitch", "pitch_rad"), ("heading", "yaw_rad")):
        table[name] = np.radians(table.pop(angle))
    table.to_csv(out, float_format="%.12g")


if __name__ == "__main__":
    values = dict(argument.split("=") for argument in sys.argv[3:])
    main(Path(sys.argv[1]), Path(sys.argv[2]), **{name: float(value) for name, value in values.items()})
