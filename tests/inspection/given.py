"""The given recordings of ../shared/data, and simulated ones beside them."""

from dataclasses import replace

import numpy as np
import pandas as pd

from jerkbench.cli.recordings import dataset_of
from jerkbench.datasets.field import FieldWhite
from jerkbench.datasets.path import DrivenPath
from jerkbench.recording import Imu, Position, Recording, Reference

LOADED = {
    "drive": ("rtklib_drive_0708", None),
    "comma2k19": ("comma2k19", None),
    "xsens": ("robot_localization/xsens.bag", "xsens_bag"),
    "husky": ("robot_localization/test1.bag", "husky_bag"),
    "broad": ("broad", None),
    "tokyo_1105": ("degraded/tokyo_1105", None),
    "hamburg": ("degraded/hamburg", "hamburg"),
    "beijing_car": ("degraded/beijing_car", None),
    "pixel4": ("degraded/pixel4", None),
}

KITTI_SIGMA_M = np.array([0.3, 0.3, 0.6])


def kitti(folder, name, until_s=np.inf, *, attitude=True, noise=1.0):
    """A car with white fixes at 1 Hz: 0.3, 0.3, 0.6 m, times ``noise``; the sigmas that are stated stay."""
    rows = pd.read_parquet(folder / "kitti" / f"{name}.parquet").astype(float)
    rows = rows[rows.t - rows.t.iloc[0] < until_s]
    t_s, enu = (rows.t - rows.t.iloc[0]).to_numpy(), rows[["e", "n", "u"]].to_numpy()
    fix = np.arange(50, len(rows), 100)
    error = noise * np.random.default_rng(0).normal(0.0, KITTI_SIGMA_M, (len(fix), 3))
    position = Position(t_s[fix], enu[fix] + error, np.tile(np.diag(KITTI_SIGMA_M**2), (len(fix), 1, 1)))
    euler = rows[["roll", "pitch", "yaw"]].to_numpy() if attitude else None
    imu = Imu(t_s, rows[["ax", "ay", "az"]].to_numpy(), rows[["gx", "gy", "gz"]].to_numpy())
    return Recording(name, imu, Reference(t_s, "RTK", independent=True, euler_rad=euler), position)


def repoimu(folder, name):
    """A stick in a hand, without fixes."""
    rows = pd.read_parquet(folder / "repoimu" / f"{name}.parquet").astype(float)
    imu = Imu(rows.t_s.to_numpy(), rows[["ax", "ay", "az"]].to_numpy(), rows[["gx", "gy", "gz"]].to_numpy())
    return Recording(name, imu, Reference(np.array([0.0]), "none", independent=True))


def taroz(folder):
    """A car's single-point fixes with their own sigmas, beside Applanix."""
    path = folder / "journeys" / "taroz" / "nagoya_20240720"
    fixes, truth = (pd.read_parquet(path / f"{name}.parquet").astype(float) for name in ("fixes", "reference"))
    covariance = np.array([np.diag(row**2) for row in fixes[["sd_e_m", "sd_n_m", "sd_u_m"]].to_numpy()])
    position = Position(fixes.t_s.to_numpy(), fixes[["e_m", "n_m", "u_m"]].to_numpy(), covariance)
    places = truth[["e_m", "n_m", "u_m"]].to_numpy()
    return Recording("taroz", None, Reference(truth.t_s.to_numpy(), "", independent=True, enu_m=places), position)


def in_a_hand(lead_s, waypoints_m=None, speed_mps=1.4):
    """A walker whose hand points where he goes ``lead_s`` later: the stamps are right, and so are the axes."""
    walk = {} if waypoints_m is None else {"waypoints_m": waypoints_m}
    recording = DrivenPath(speed_mps=speed_mps, vibration_mps2=0.5, **walk).load(0)
    imu, reference = recording.imu, recording.reference
    yaw = np.unwrap(reference.euler_rad[:, 2])
    ahead = np.interp(imu.t_s + lead_s, reference.t_s, yaw) - np.interp(imu.t_s, reference.t_s, yaw)
    cos, sin = np.cos(ahead), np.sin(ahead)
    turn = np.array([[cos, sin, 0 * ahead], [-sin, cos, 0 * ahead], [0 * ahead, 0 * ahead, 1 + 0 * ahead]])
    force, rate = (np.einsum("abi,ib->ia", turn, values) for values in (imu.accel_mps2, imu.gyro_radps))
    rate[:, 2] += np.gradient(ahead, imu.t_s)
    return replace(recording, imu=Imu(imu.t_s, force, rate), heading=None, reference=replace(reference, euler_rad=None))


def given(folder, name):
    """Load the recording ``name``; the folder is ../shared/data."""
    if name in ("field", "path"):
        return {"field": FieldWhite, "path": DrivenPath}[name]().load(0)
    if name in LOADED:
        path, dataset = LOADED[name]
        return dataset_of(str(folder / path), dataset, []).load(0)
    if name.startswith("broad/"):
        return dataset_of(str(folder / "broad"), "broad", [f"trial={int(name[6:8])}"]).load(0)
    if name == "taroz":
        return taroz(folder)
    return repoimu(folder, name) if name.startswith("TStick") else kitti(folder, name)
