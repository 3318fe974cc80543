"""The inertial filter on real drives: another implementation, a wheel, and positions alone."""

from dataclasses import replace

import numpy as np
import pytest

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.comma2k19 import Comma2k19
from jerkbench.datasets.rtklib import RtklibDrive
from jerkbench.disturbances.outages import GnssOutage, Withhold
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.filters.eskf15 import Eskf15
from jerkbench.filters.kinematic import Baseline, Jerk
from jerkbench.inertial.compiled_runs import solve_compiled
from jerkbench.timeline import build_timeline

ARW_DEG_PER_SQRT_H, VRW_MPS_PER_SQRT_H = 6.0, 1.8

SETTINGS = [(-0.2, 0.01, 0.034), (-0.1, 0.02, 0.057)]
"""Shift of the IMU stamps, sigma of a fix, and the RMSE of python-ins and KF-GINS."""


def drive(shared_folder, imu_shift_s, phase):
    """A recording with position at 1 Hz; the other fixes are the reference."""
    folder = str(shared_folder / "data" / "rtklib_drive_0708")
    recording = RtklibDrive(folder, imu_shift_s=imu_shift_s, min_speed_mps=0.0).load()
    return Withhold(every=4, phase=phase).apply(recording, 0)


def attitude_of(recording):
    return Tilt(sigma_accel_mps2=0.5, propagation="exact").estimate(recording)


def rmse_of_eskf15(recording, sigma_m, *, compiled=False):
    """Position RMSE after the first minute."""
    model = Eskf15(ARW_DEG_PER_SQRT_H, VRW_MPS_PER_SQRT_H, use_velocity=False, position_sigma_m=sigma_m)
    run = model.estimate_compiled if compiled else model.estimate
    estimate, reference = run(recording, attitude_of(recording), NoAdaptation()), recording.reference
    late = reference.t_s[estimate.index] >= 60.0
    error = (estimate.position_m - reference.enu_m[estimate.index])[late]
    assert estimate.failure == ""
    return np.sqrt(np.mean(np.sum(error**2, axis=1)))


@pytest.mark.parametrize("phase", [0, *(pytest.param(phase, marks=pytest.mark.slow) for phase in (1, 2, 3))])
@pytest.mark.parametrize(("imu_shift_s", "sigma_m", "rmse_m"), SETTINGS)
def test_the_rmse_is_as_low_as_in_other_implementations(shared_folder, imu_shift_s, sigma_m, rmse_m, phase):
    recording = drive(shared_folder, imu_shift_s, phase)

    rmse = rmse_of_eskf15(recording, sigma_m, compiled=True)
    assert rmse == pytest.approx(rmse_m, abs=0.003)
    if phase == 0 and imu_shift_s == -0.2:  # NumPy takes seconds for it
        assert rmse == pytest.approx(rmse_of_eskf15(recording, sigma_m), abs=1e-9)


TRUE_SCALE = 1.0 / 1.0087 - 1.0
"""Scale of the wheel speed on the bus of the car, fitted on the reference."""


@pytest.fixture(scope="module")
def car(shared_folder):
    """The recording with the wheel speed of the bus, without its known correction."""
    recording = Comma2k19(str(shared_folder / "data" / "comma2k19"), wheel_scale=1.0).load(0)
    recording = GnssOutage(windows_s=((20.0, 40.0),)).apply(recording, 0)
    return recording, Tilt(sigma_accel_mps2=0.5, propagation="exact").estimate(recording)


def solve(car, *, wheel_scale):
    recording, attitude = car
    model = Eskf15(6.0, 1.8, nonholonomic=True, wheel_scale=wheel_scale)
    solution = solve_compiled(model.inputs(recording, attitude), NoAdaptation())
    estimate, truth = solution.estimate, recording.reference
    t_s = truth.t_s[estimate.index]
    level = np.linalg.norm((estimate.position_m - truth.enu_m[estimate.index])[:, :2], axis=1)
    return solution, np.sqrt(np.mean(level[(t_s >= 20.0) & (t_s < 40.0)] ** 2))


@pytest.mark.slow
def test_the_estimated_scale_agrees_with_the_fit_on_the_reference(car):
    (solution, found_m), (_, trusted_m) = solve(car, wheel_scale=True), solve(car, wheel_scale=False)
    sigma = np.sqrt(solution.covariance[15, 15])

    assert sigma < 1e-3
    assert solution.state.wheel_scale == pytest.approx(TRUE_SCALE, abs=3 * sigma)
    assert found_m < 0.5  # the reference is right to decimetres
    assert trusted_m > 4 * found_m


REAL = Tilt(sigma_accel_mps2=0.5, propagation="exact")
MODELS = [
    pytest.param(Baseline(2.0), id="baseline"),
    pytest.param(Jerk(), id="jerk"),
    pytest.param(Eskf15(6.0, 1.8), id="eskf15"),
]


def positions_of(recording):
    """The recording with the position fixes and the IMU only."""
    return replace(recording, velocity=None, heading=None)


def rmse_m(recording, attitude, model):
    """Position RMSE after 5 s, at the scored stamps of the reference."""
    if isinstance(model, Eskf15):
        estimate = model.estimate_compiled(recording, attitude, NoAdaptation())
    else:
        estimate = CompiledEngine().run(build_timeline(recording, attitude), model, NoAdaptation())
    reference, rows = recording.reference, estimate.index
    counted = reference.scored[rows] & (reference.t_s[rows] >= 5.0)
    error = (estimate.position_m - reference.enu_m[rows])[counted]
    assert estimate.failure == ""
    return np.sqrt(np.nanmean(np.sum(error**2, axis=1)))


@pytest.fixture(scope="module")
def real(shared_folder):
    data = shared_folder / "data"
    drive = Withhold(phase=0).apply(RtklibDrive(str(data / "rtklib_drive_0708")).load(), 0)
    return {"drive": drive, "comma2k19": Comma2k19(str(data / "comma2k19")).load()}


@pytest.mark.slow
@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("name", ["drive", "comma2k19"])
def test_a_real_car_without_its_velocities(real, name, model):
    full, bare = real[name], positions_of(real[name])

    assert rmse_m(bare, REAL.estimate(bare), model) < 1.5 * rmse_m(full, REAL.estimate(full), model)
