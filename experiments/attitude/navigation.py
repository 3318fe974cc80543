"""What the tilt is worth to the navigation: the same attitudes under baseline and jerk on KITTI's drives.

    python experiments/attitude/navigation.py FOLDER [ROWS [DRIVES]]

FOLDER holds kitti. The fixes are the reference's places with the replayed errors of two receivers: semi-real. Each
attitude has the setting with the lowest mean log error of the tilt on the other drives. DRIVES may be fewer than all.
"""

import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
from page import KEPT, KINEMATIC, NAVIGATION

from jerkbench.api import disturb, estimate, evaluate
from jerkbench.attitude.reference import ReferenceAttitude
from jerkbench.audit.attitude.methods import METHODS
from jerkbench.audit.attitude.tuned import TiltErrors, errors_of
from jerkbench.recording import Imu, Position, Recording, Reference

UNSOUND = ("2011_09_30_drive_0028", "2011_09_26_drive_0093")
"""Their places have steps."""

TRACES = ("tokyo_1105", "pixel4")
TILTS = ("constant", "mtf", "mekf", "madgwick", "mahony", "vqf")
INERTIAL = "eskf15_tactical"
ERROR = "position_rmse_m"
WORKERS = 2
EVERY = 20
"""Samples from fix to fix: 5 Hz."""

FIX_M2 = 1e-4
"""The variance of the places themselves."""


def drive(path: Path) -> Recording:
    """A whole drive with fixes that are exact, until a receiver's errors are laid over them."""
    table = pd.read_parquet(path).astype(float)
    t_s = (table["t"] - table["t"].iloc[0]).to_numpy()
    accel, gyro, place, velocity, euler = (
        table[names.split()].to_numpy() for names in ("ax ay az", "gx gy gz", "e n u", "ve vn vu", "roll pitch yaw")
    )
    at = np.arange(0, len(t_s), EVERY)
    covariance = np.tile(FIX_M2 * np.eye(3), (len(at), 1, 1))
    return Recording(
        path.stem,
        Imu(t_s, accel, gyro),
        Reference(t_s, "OXTS", independent=False, enu_m=place, velocity_mps=velocity, euler_rad=euler),
        position=Position(t_s[at], place[at], covariance),
    )


def setting_for(errors: TiltErrors, method: str, number: int) -> int:
    """The best setting on all drives but one."""
    others = np.delete(errors["kitti"][method], number, axis=1)
    return int(others.mean(axis=1).argmin())


def rows_of(path: Path, number: int) -> list[tuple[str, str, str, str, float]]:
    """Drive, trace, filter, attitude, RMSE of the position [m]."""
    return list(_rows(path, number))


def _rows(path: Path, number: int) -> Iterator[tuple[str, str, str, str, float]]:
    errors = errors_of(pd.read_parquet(KEPT))
    exact = drive(path)
    rate_hz = 1.0 / exact.inertial.nominal_interval_s
    settings = {name: METHODS[name].settings()[setting_for(errors, name, number)] for name in TILTS}
    attitudes = {name: METHODS[name].make(setting, rate_hz) for name, setting in settings.items()}
    attitudes["reference"] = ReferenceAttitude(gap_s=1.0)
    for trace in TRACES:
        recording = disturb(exact, {"name": "replayed_gnss", "trace": trace}, seed=number)
        for name, attitude in attitudes.items():
            for model in KINEMATIC:
                navigated = estimate(recording, filter=model, attitude=attitude, noise="real")
                yield path.stem, trace, model, name, evaluate(navigated, recording, metrics=["position_rmse"])[ERROR]
        navigated = estimate(recording, filter=INERTIAL, attitude=attitudes["constant"])
        yield path.stem, trace, INERTIAL, "its own", evaluate(navigated, recording, metrics=["position_rmse"])[ERROR]


def main() -> None:
    """Run them, and keep the rows."""
    folder = Path(sys.argv[1]) / "kitti"
    kept = Path(sys.argv[2]) if len(sys.argv) > 2 else NAVIGATION
    paths = sorted(folder.glob("*drive*.parquet"))
    drives = [(path, number) for number, path in enumerate(paths) if path.stem not in UNSOUND]
    drives = drives[: int(sys.argv[3]) if len(sys.argv) > 3 else None]
    with ProcessPoolExecutor(WORKERS, get_context("spawn")) as pool:
        found = [row for rows in pool.map(rows_of, *zip(*drives, strict=True)) for row in rows]
    table = pd.DataFrame(found, columns=["drive", "trace", "filter", "attitude", ERROR])
    table.astype({ERROR: "float32"}).to_parquet(kept, index=False)
    print(table.groupby(["filter", "attitude", "trace"])[ERROR].median().to_string())


if __name__ == "__main__":
    main()
