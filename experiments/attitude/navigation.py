"""What the tilt is worth to the navigation: the same attitudes under baseline and jerk on KITTI's drives.

The fixes are the reference's places with the replayed errors of two receivers: semi-real. Each attitude has the setting
with the lowest median log error of the tilt on the drives of other days, without and with a known start.
"""

from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
from tables import VERDICT_HEADS, Errors, lowest, verdict_cells, verdicts_on
from trials import METHODS, plain_table, session_of, with_noise

from jerkbench.api import disturb, estimate, evaluate
from jerkbench.attitude.common import TiltAndYaw
from jerkbench.attitude.reference import ReferenceAttitude
from jerkbench.estimate import Attitude
from jerkbench.recording import Imu, Position, Recording, Reference, Velocity

UNSOUND = ("2011_09_30_drive_0028", "2011_09_26_drive_0093")
"""Their places have steps."""

TRACES = ("tokyo_1105", "pixel4")
TILTS = ("constant", "mtf", "mekf", "madgwick", "mahony", "vqf")
KINEMATIC, INERTIAL = ("baseline", "jerk"), "eskf15_tactical"
ERROR = "position_rmse_m"
COLUMNS = ["drive", "trace", "filter", "attitude", ERROR]

EVERY = 20
"""Samples from fix to fix: 5 Hz."""

FIX_M2 = 1e-4
"""The variance of the places themselves."""


@dataclass(frozen=True)
class StartKnown:
    """An attitude filter that starts by a velocity over ground, which the navigation filter does not get."""

    plugin: TiltAndYaw
    velocity: Velocity

    def estimate(self, recording: Recording) -> Attitude:
        """Return the attitude; yaw comes from the track of the fixes as without."""
        plugin = replace(self.plugin, alignment="track", yaw_source="track")
        return plugin.estimate(replace(recording, velocity=self.velocity))


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


def navigation_rows(folder: Path, errors: Errors, drives: int | None, workers: int) -> pd.DataFrame:
    """Drive, trace, filter, attitude, RMSE of the position [m], of the first ``drives`` (None: all)."""
    paths = sorted(folder.glob("*drive*.parquet"))
    places = [(path, number) for number, path in enumerate(paths) if path.stem not in UNSOUND][:drives]
    chosen = [
        {
            (name, domain): lowest([errors[domain].on_other_sessions(name, session_of(domain, path.stem))])
            for name in TILTS
            for domain in ("kitti", "kitti_start")
        }
        for path, _ in places
    ]
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        found = [row for rows in pool.map(_drive_rows, *zip(*places, strict=True), chosen) for row in rows]
    return pd.DataFrame(found, columns=COLUMNS).astype({ERROR: "float32"})


def _drive_rows(path: Path, number: int, chosen: dict[tuple[str, str], int]) -> list[tuple[str, str, str, str, float]]:
    return list(_rows(path, number, chosen))


def _rows(path: Path, number: int, chosen: dict[tuple[str, str], int]) -> Iterator[tuple[str, str, str, str, float]]:
    exact = drive(path)
    rate_hz = 1.0 / exact.inertial.nominal_interval_s
    reference = exact.reference
    velocity = with_noise(reference.t_s, np.asarray(reference.velocity_mps), number)
    attitudes: dict[str, object] = {"reference": ReferenceAttitude(gap_s=1.0)}
    for (name, domain), setting in chosen.items():
        plugin = METHODS[name].plugin(METHODS[name].settings()[setting], rate_hz)
        known = domain == "kitti_start"
        attitudes[f"{name}, start known" if known else name] = StartKnown(plugin, velocity) if known else plugin
    for trace in TRACES:
        recording = disturb(exact, {"name": "replayed_gnss", "trace": trace}, seed=number)
        for name, attitude in attitudes.items():
            for model in KINEMATIC:
                navigated = estimate(recording, filter=model, attitude=attitude, noise="real")
                yield path.stem, trace, model, name, evaluate(navigated, recording, metrics=["position_rmse"])[ERROR]
        for name in ("constant", "constant, start known"):
            navigated = estimate(recording, filter=INERTIAL, attitude=attitudes[name])
            yield path.stem, trace, INERTIAL, name, evaluate(navigated, recording, metrics=["position_rmse"])[ERROR]


def navigation_table(rows: pd.DataFrame) -> str:
    """Position errors with each attitude, and of eskf15, against the position errors with `constant`."""
    rows = rows.assign(loss=np.log(rows[ERROR].astype(float)))
    mean = rows.pivot_table(index=["filter", "attitude"], columns="drive", values="loss")  # over the traces
    inertial = {
        str(name).replace("constant", "eskf15"): mean.loc[(INERTIAL, name)] for name in mean.loc[INERTIAL].index
    }
    parts = []
    for model in KINEMATIC:
        own = {str(name): mean.loc[(model, name)] for name in mean.loc[model].index} | inertial
        found = verdicts_on({name: loss.to_numpy()[None] for name, loss in own.items()}, "constant")
        head = [f"{model} (n = {mean.shape[1]})", *VERDICT_HEADS]
        parts.append(plain_table(head, [[name, *verdict_cells(verdict)] for name, verdict in found.items()]))
    return "\n\n".join(parts)
