"""Logs of positions alone: as good as their velocities, or a known attitude, let them be."""

from dataclasses import replace

import numpy as np
import pytest

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude.reference import ReferenceAttitude
from jerkbench.attitude.tilt import Tilt
from jerkbench.datasets.comma2k19 import Comma2k19
from jerkbench.datasets.path import DrivenPath
from jerkbench.datasets.rtklib import RtklibDrive
from jerkbench.disturbances.withhold import Withhold
from jerkbench.engines.compiled_engine import CompiledEngine
from jerkbench.filters.eskf15 import Eskf15
from jerkbench.filters.kinematic import Baseline, Jerk
from jerkbench.timeline import build_timeline

REAL = Tilt(sigma_accel_mps2=0.5, propagation="exact")
MODELS = [
    pytest.param(Baseline(2.0), id="baseline"),
    pytest.param(Jerk(), id="jerk"),
    pytest.param(Eskf15(6.0, 1.8), id="eskf15"),
]


def positions_of(recording):
    """Nothing but the fixes."""
    return replace(recording, velocity=None, heading=None)


def rmse_m(recording, attitude, model):
    """Position RMSE where the reference is scored, from 5 s on."""
    if isinstance(model, Eskf15):
        estimate = model.estimate(recording, attitude, NoAdaptation())
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
    whole, bare = real[name], positions_of(real[name])

    assert rmse_m(bare, REAL.estimate(bare), model) < 1.5 * rmse_m(whole, REAL.estimate(whole), model)


@pytest.mark.parametrize("model", MODELS)
def test_a_simulated_car_against_its_known_attitude(model):
    way = ((0.0, 0.0), (150.0, 0.0), (180.0, 30.0), (180.0, 200.0), (150.0, 230.0), (0.0, 230.0))
    path = DrivenPath(waypoints_m=way, ramp_s=6.0, speed_mps=10.0, gnss_rate_hz=1.0, position_sigma_m=(0.4, 0.4, 0.8))
    bare = [positions_of(path.load(seed)) for seed in range(2)]
    track, known = (
        np.mean([rmse_m(one, attitude.estimate(one), model) for one in bare])
        for attitude in (Tilt(), ReferenceAttitude())
    )

    assert track < 1.3 * known
