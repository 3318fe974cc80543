"""Write the log of the tutorial docs/own_log.md: the CSV files imu.csv, gnss.csv and truth.csv of a simulated car.

    python examples/example_log.py [FOLDER]

The accelerometer is in g, the gyro is in deg/s, and the IMU axes are forward, right and down. The stamps of the IMU are
0.3 s late. The fixes have a gap of 8 s, and their standard deviations are in mm. The car is at rest for 10 s.
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd

FRD = np.diag([1.0, -1.0, -1.0])
LATE_S, GAP_S, SIGMA_M = 0.3, (120.0, 128.0), np.array([0.03, 0.03, 0.06])
START_S = 1_715_695_200.0  # 14 May 2024, 14:00 UTC
GRAVITY_MPS2 = 9.80665


def motion(t_s):
    """Return the speed (n,) [m/s], the turn rate (n,) [rad/s] and the positions (n, 3) in ENU [m] at the times."""
    moving = np.clip((t_s - 10) / 5, 0, 1)
    speed = moving * (8 + 3 * np.sin(2 * np.pi * t_s / 37) + 1.5 * np.sin(2 * np.pi * t_s / 11))
    turn = moving * (0.25 * np.sin(2 * np.pi * t_s / 23) + 0.15 * np.sin(2 * np.pi * t_s / 9))
    yaw = 0.4 + np.cumsum(turn) / 100
    velocity = np.column_stack([speed * np.cos(yaw), speed * np.sin(yaw), 0 * t_s])
    return speed, turn, np.cumsum(velocity, axis=0) / 100


def geodetic(enu_m):
    """Return latitude, longitude and height near 48 degrees north, with the radii of curvature of WGS-84."""
    latitude, e2, a = np.radians(48.0), 6.69437999014e-3, 6_378_137.0
    normal = a / np.sqrt(1 - e2 * np.sin(latitude) ** 2)
    meridian = normal * (1 - e2) / (1 - e2 * np.sin(latitude) ** 2)
    east = 11.0 + np.degrees(enu_m[:, 0] / ((normal + 500) * np.cos(latitude)))
    return {"lat": 48.0 + np.degrees(enu_m[:, 1] / (meridian + 500)), "lon": east, "alt": 500 + enu_m[:, 2]}


def unix_time(seconds):
    """Return the column with the stamps as Unix time [s]."""
    return {"timestamp": np.round(START_S + seconds, 4)}


def write_log(folder, seed=7, stamps=unix_time):
    """Write the three files, and return their paths, specific forces, turn rates, times of the fixes and true path."""
    draw, t_s = np.random.default_rng(seed), np.arange(24_000) / 100
    speed, turn, true_m = motion(t_s)
    force = np.column_stack([np.gradient(speed, t_s), speed * turn, np.full(len(t_s), GRAVITY_MPS2)])
    force += draw.normal(0, 0.05, force.shape)
    rate = np.column_stack([0 * turn, 0 * turn, turn]) + draw.normal(0, 0.002, force.shape)
    fixes = np.flatnonzero((np.arange(len(t_s)) % 20 == 0) & ((t_s < GAP_S[0]) | (t_s > GAP_S[1])))
    measured = true_m[fixes] + draw.normal(0, 1, (len(fixes), 3)) * SIGMA_M

    imu = dict(zip(["acc_x_g", "acc_y_g", "acc_z_g"], (force @ FRD / GRAVITY_MPS2).T, strict=True))
    imu |= dict(zip(["gyro_x_dps", "gyro_y_dps", "gyro_z_dps"], np.degrees(rate @ FRD).T, strict=True))
    sigma = dict(zip(["sde_mm", "sdn_mm", "sdu_mm"], 1000 * SIGMA_M, strict=True))
    tables = {
        "imu.csv": {**stamps(t_s + LATE_S), **imu},
        "gnss.csv": {**stamps(t_s[fixes]), **geodetic(measured), **sigma},
        "truth.csv": {**stamps(t_s[::10]), **geodetic(true_m[::10])},
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, table in tables.items():
        pd.DataFrame(table).to_csv(folder / name, index=False)
    return [folder / name for name in tables], force, rate, t_s[fixes], true_m[::10] - true_m[0]


if __name__ == "__main__":
    target = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    if present := [name for name in ("imu.csv", "gnss.csv", "truth.csv") if (target / name).exists()]:
        sys.exit(f"{target / present[0]} already exists; give another folder.")
    write_log(target)
