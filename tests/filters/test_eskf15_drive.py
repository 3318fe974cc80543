"""The inertial navigation on the real drive, beside an independent implementation (python-ins)."""

from dataclasses import fields, replace

import numpy as np
import pytest

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.rtklib import RtklibDrive
from jerkbench.disturbances.withhold import Withhold
from jerkbench.filters.eskf15 import Eskf15
from jerkbench.geometry import enu_to_geodetic, geodetic_to_enu

ARW_DEG_PER_SQRT_H, VRW_MPS_PER_SQRT_H = 6.0, 1.8

SETTINGS = [(-0.2, 0.01, 0.034), (-0.1, 0.02, 0.057)]
"""Shift of the IMU's stamps, sigma of a fix, and the RMSE that python-ins and KF-GINS reach."""


def drive(shared_folder, imu_shift_s, phase=0, end_s=np.inf):
    """Position at 1 Hz up to ``end_s``; the fixes between are the reference."""
    folder = str(shared_folder / "data" / "rtklib_drive_0708")
    recording = RtklibDrive(folder, imu_shift_s=imu_shift_s, min_speed_mps=0.0).load()
    if np.isfinite(end_s):
        parts = {name: up_to(getattr(recording, name), end_s) for name in ("imu", "position", "velocity", "reference")}
        recording = replace(recording, **parts)
    return Withhold(every=4, phase=phase).apply(recording, 0)


def up_to(stream, end_s):
    """The rows of a stream up to a time."""
    rows = stream.t_s <= end_s
    values = {field.name: getattr(stream, field.name) for field in fields(stream)}
    return replace(
        stream, **{n: v[rows] for n, v in values.items() if isinstance(v, np.ndarray) and len(v) == len(rows)}
    )


def attitude_of(recording):
    return Tilt(sigma_accel_mps2=0.5, propagation="exact").estimate(recording)


def rmse_after_60_s(recording, t_s, enu_m):
    late = t_s >= 60.0
    truth = recording.reference.enu_m[np.searchsorted(recording.reference.t_s, t_s[late] - 1e-6)]
    return np.sqrt(np.mean(np.sum((enu_m[late] - truth) ** 2, axis=1)))


def rmse_of_eskf15(recording, sigma_m, *, compiled=False):
    model = Eskf15(ARW_DEG_PER_SQRT_H, VRW_MPS_PER_SQRT_H, use_velocity=False, position_sigma_m=sigma_m)
    run = model.estimate_compiled if compiled else model.estimate
    estimate = run(recording, attitude_of(recording), NoAdaptation())
    assert estimate.failure == ""
    return rmse_after_60_s(recording, recording.reference.t_s[estimate.index], estimate.position_m)


@pytest.mark.parametrize("phase", [0, *(pytest.param(phase, marks=pytest.mark.slow) for phase in (1, 2, 3))])
@pytest.mark.parametrize(("imu_shift_s", "sigma_m", "rmse_m"), SETTINGS)
def test_it_reaches_what_other_implementations_reach(shared_folder, imu_shift_s, sigma_m, rmse_m, phase):
    recording = drive(shared_folder, imu_shift_s, phase)

    rmse = rmse_of_eskf15(recording, sigma_m, compiled=True)
    assert rmse == pytest.approx(rmse_m, abs=0.003)
    assert rmse == pytest.approx(rmse_of_eskf15(recording, sigma_m), abs=1e-9)


@pytest.mark.slow  # half a minute
@pytest.mark.filterwarnings("ignore:The copy keyword is deprecated")  # python-ins with pandas 3
def test_python_ins_goes_the_same_way(shared_folder):
    pytest.importorskip("pyins")
    recording = drive(shared_folder, -0.2, end_s=240.0)
    t_s, enu_m = run_python_ins(recording, 0.01)
    theirs, ours = rmse_after_60_s(recording, t_s, enu_m), rmse_of_eskf15(recording, 0.01)

    assert ours == pytest.approx(theirs, abs=0.001)


def run_python_ins(recording, sigma_m):
    """Position (k, 3) at the reference's stamps t_s (k,), between its own steps along the chord."""
    import pandas as pd
    from pyins import filters, inertial_sensor, measurements, strapdown

    flip = np.array([1.0, -1.0, -1.0])  # FLU -> FRD
    imu, fixes, reference = recording.imu, recording.position, recording.reference
    dt = np.diff(imu.t_s, prepend=imu.t_s[0] - imu.nominal_interval_s)[:, None]
    columns = ["gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z"]
    samples = np.hstack([imu.gyro_radps * flip * dt, imu.accel_mps2 * flip * dt])
    increments = strapdown.compute_increments_from_imu(pd.DataFrame(samples, imu.t_s, columns), "increment")
    start = np.flatnonzero(fixes.t_s > imu.t_s[1])[0]
    first = int(np.searchsorted(increments.index, fixes.t_s[start]))
    roll, pitch, yaw = np.rad2deg(attitude_of(recording).euler_rad[first])
    names = ["lat", "lon", "alt"]
    lla = enu_to_geodetic(fixes.enu_m, recording.origin)
    pva = pd.Series(
        [*lla[start], 0.0, 0.0, 0.0, roll, -pitch, 90.0 - yaw],
        [*names, "VN", "VE", "VD", "roll", "pitch", "heading"],
        name=increments.index[first],
    )
    sensors = (
        {"bias_sd": 0.0024, "noise": np.deg2rad(ARW_DEG_PER_SQRT_H) / 60},
        {"bias_sd": 0.1, "noise": VRW_MPS_PER_SQRT_H / 60},
    )
    gyro_model, accel_model = (inertial_sensor.EstimationModel(**sensor) for sensor in sensors)
    result = filters.run_feedback_filter(
        pva,
        *(0.02, 0.02, 1.0, 3.0),
        increments.iloc[first + 1 :],
        gyro_model,
        accel_model,
        [measurements.Position(pd.DataFrame(lla, fixes.t_s, names), sigma_m)],
        time_step=0.25,  # it is slow
    )
    path = enu_from_geodetic(result.trajectory[names].to_numpy(), recording.origin)
    t_s = reference.t_s[(reference.t_s > result.trajectory.index[0]) & (reference.t_s < result.trajectory.index[-1])]
    return t_s, np.column_stack([np.interp(t_s, result.trajectory.index, axis) for axis in path.T])


def enu_from_geodetic(lla, origin):
    return geodetic_to_enu(lla[:, 0], lla[:, 1], lla[:, 2], origin)
