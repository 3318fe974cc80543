"""KF-GINS over a recording: python kf_gins.py PROGRAM recording.csv OUT.nav [NAME=VALUE ...].

Without OUT.nav, only the input files are written. Each NAME=VALUE changes one of the SETTINGS, for example arw=0.6.
"""

import json
import shutil
import subprocess
import sys
from datetime import datetime
from pathlib import Path

import numpy as np
import pandas as pd
from pymap3d import enu2geodetic
from scipy.spatial.transform import Rotation

GPS_EPOCH, WEEK_S, GPST_MINUS_UTC_S = datetime.fromisoformat("1980-01-06T00:00:00+00:00"), 604_800, 18
FLU_FROM_FRD = np.diag([1.0, -1.0, -1.0])
ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
CONFIGURATION = """\
imupath: "{folder}/imu.txt"
gnsspath: "{folder}/gnss.txt"
outputpath: "{folder}"
imudatalen: 7
imudatarate: {rate_hz} # [Hz]
starttime: {start_s:.9f} # [s of the GPS week {week}]
endtime: {end_s:.9f} # [s]
initpos: {place} # latitude, longitude [deg], height [m]
initvel: {velocity} # north, east, down [m/s]
initatt: {attitude} # roll, pitch, yaw, NED and FRD [deg]
initgyrbias: [0, 0, 0] # [deg/h]
initaccbias: [0, 0, 0] # [mGal]
initgyrscale: [0, 0, 0] # [ppm]
initaccscale: [0, 0, 0] # [ppm]
initposstd: {position_sd} # north, east, down [m]
initvelstd: [0.1, 0.1, 0.1] # [m/s]
initattstd: [1.0, 1.0, 3.0] # [deg]
initbgstd: [{initbg}, {initbg}, {initbg}] # [deg/h]
initbastd: [{initba}, {initba}, {initba}] # [mGal]
imunoise:
  arw: [{arw}, {arw}, {arw}] # [deg/sqrt(h)]
  vrw: [{vrw}, {vrw}, {vrw}] # [m/s/sqrt(h)]
  gbstd: [{gbstd}, {gbstd}, {gbstd}] # [deg/h]
  abstd: [{abstd}, {abstd}, {abstd}] # [mGal]
  gsstd: [{gsstd}, {gsstd}, {gsstd}] # [ppm]
  asstd: [{asstd}, {asstd}, {asstd}] # [ppm]
  corrtime: {corrtime} # [h]
antlever: [0.0, 0.0, 0.0] # forward, right, down [m]
"""

SETTINGS = {  # of a small consumer IMU; replace it by the noise of your IMU
    "arw": 0.3,  # deg/sqrt(h), white noise of the gyro
    "vrw": 0.3,  # m/s/sqrt(h), white noise of the accelerometer
    "gbstd": 30.0,  # deg/h, changes of the gyro bias during the time corrtime
    "abstd": 500.0,  # mGal, changes of the accelerometer bias
    "gsstd": 300.0,  # ppm, scale factor of the gyro
    "asstd": 300.0,  # ppm, scale factor of the accelerometer
    "corrtime": 1.0,  # h
    "initbg": 30.0,  # deg/h, initial gyro bias
    "initba": 500.0,  # mGal, initial accelerometer bias
    "position": 1.0,  # factor on the covariance of fixes
}


def columns(table: pd.DataFrame, stream: str, unit: str, axes: str) -> pd.DataFrame:
    """Return three columns of a stream in the rows that have all of them."""
    return table[[f"{stream}_{axis}_{unit}" for axis in axes.split()]].dropna()


def write_input(recording: Path, folder: Path, **changed: float) -> None:
    """Write imu.txt (increments), gnss.txt and kf-gins.yaml; times are seconds of the GPS week of the start."""
    use = SETTINGS | changed
    table = pd.read_csv(recording, index_col="t_s")
    about = json.loads(recording.with_suffix(".json").read_text(encoding="utf-8"))
    since_s = (datetime.fromisoformat(about["time"]["start_utc"]) - GPS_EPOCH).total_seconds() + GPST_MINUS_UTC_S
    week, zero_s = divmod(since_s, WEEK_S)

    accel, gyro = columns(table, "accel", "mps2", "forward left up"), columns(table, "gyro", "radps", "forward left up")
    interval_s = np.diff(accel.index)
    interval_s = np.concatenate([[np.median(interval_s)], interval_s])[:, None]
    increments = [values.to_numpy() @ FLU_FROM_FRD * interval_s for values in (gyro, accel)]
    imu = np.column_stack([zero_s + accel.index, *increments])

    fixes = columns(table, "position", "m", "east north up")
    places = np.column_stack(enu2geodetic(*fixes.to_numpy().T, *about["origin"].values()))
    sd = np.sqrt(table.loc[fixes.index, [f"position_variance_{axis}_m2" for axis in ("22", "11", "33")]].to_numpy())
    sd *= np.sqrt(use["position"])
    gnss = np.column_stack([zero_s + fixes.index, places, sd])

    begin = fixes.index[0]
    angles = columns(table, "attitude", "rad", "yaw pitch roll").loc[begin:].iloc[0]
    turn = ENU_FROM_NED.T @ Rotation.from_euler("ZYX", angles).as_matrix() @ FLU_FROM_FRD
    velocity = np.zeros(3)
    if "velocity_east_mps" in table:
        known = columns(table, "velocity", "mps", "east north up").loc[:begin]
        velocity = ENU_FROM_NED.T @ known.iloc[-1] if len(known) else velocity
    text = CONFIGURATION.format(
        **use,
        folder=folder.resolve(),
        rate_hz=round(1.0 / np.median(interval_s)),
        week=int(week),
        start_s=zero_s + begin,
        end_s=zero_s + accel.index[-1],
        place=[round(value, 10) for value in places[0].tolist()],
        velocity=[round(value, 4) for value in velocity.tolist()],
        attitude=[round(v, 6) for v in Rotation.from_matrix(turn).as_euler("ZYX", degrees=True)[::-1].tolist()],
        position_sd=[round(value, 4) for value in sd[0].tolist()],
    )
    folder.mkdir(parents=True, exist_ok=True)
    np.savetxt(folder / "imu.txt", imu, "%.9f" + " %.12e" * 6)
    np.savetxt(folder / "gnss.txt", gnss, "%.9f %.11f %.11f %.5f %.5f %.5f %.5f")
    (folder / "kf-gins.yaml").write_text(text, encoding="utf-8")


def main(program: str, recording: Path, out: Path | None = None, **changed: float) -> None:
    """Write the input of KF-GINS beside the recording, run the program, and copy its trajectory to ``out``."""
    folder = recording.parent / "kf_gins"
    write_input(recording, folder, **changed)
    if out is not None:
        subprocess.run([program, str(folder / "kf-gins.yaml")], check=True, stdout=subprocess.DEVNULL)  # noqa: S603 - the program that the user names
        shutil.copy(folder / "KF_GINS_Navresult.nav", out)


if __name__ == "__main__":
    values = dict(argument.split("=") for argument in sys.argv[4:])
    main(sys.argv[1], *map(Path, sys.argv[2:4]), **{name: float(value) for name, value in values.items()})
