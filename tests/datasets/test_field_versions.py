"""Old numbers stay with field_white; the sensors of field err as they say."""

from pathlib import Path

import numpy as np
import pytest

from jerkbench import run
from jerkbench.datasets.field import Field, FieldWhite
from jerkbench.errors import PluginError
from jerkbench.geometry import dcm_from_euler
from jerkbench.jobs.names import choose
from jerkbench.jobs.study import load_study
from jerkbench.plugins import create

KEPT = Path(__file__).parents[2] / "results" / "paper20"
GOLDEN = {
    ("none", "jerk", "none"): (0.015630116090114284, 4.303542318399316),
    ("multipath_single_axis", "baseline", "mtf"): (0.03200351636407505, 4.890663873242818),
    ("rtk_float", "jerk", "none"): (0.39495630160870465, 82.93338718997019),
    ("wheel_slip", "jerk", "sage_husa"): (0.018802518696758343, 5.591112110042042),
    ("outliers", "jerk", "chi2"): (0.015676376958248465, 4.325723156798601),
}
"""RMSE [m] and ANEES of seed 0 over 60 s, from the code before there was a second version."""

COLOURED = {name for name, value in vars(FieldWhite()).items() if value != vars(Field())[name]}
"""The parameters by which the versions differ."""

COMMITTED = {
    ("none", "jerk", "none"): "0.0162",
    ("multipath_single_axis", "baseline", "mtf"): "0.0234",
}
"""Cells of the first published table: arithmetic means of 20 seeds."""


@pytest.mark.parametrize("cell", GOLDEN)
def test_old_numbers_stay(cell):
    disturbance, model, adaptation = cell
    dataset = {"name": "field_white", "duration_s": 60.0}
    row = run(dataset=dataset, disturbance=disturbance, filter=model, adaptation=adaptation, seeds=1).iloc[0]
    assert (row.position_rmse_m, row.anees) == pytest.approx(GOLDEN[cell], rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("cell", COMMITTED)
def test_the_committed_rows_are_those_of_the_first_version(cell):
    disturbance, model, adaptation = cell
    rows = run(dataset="field_white", disturbance=disturbance, filter=model, adaptation=adaptation, seeds=20)
    assert f"{rows.position_rmse_m.mean():.4f}" == COMMITTED[cell]
    kept = load_study(KEPT).rows.set_index(["dataset", "disturbance", "filter", "adaptation"]).sort_index()
    kept = kept.loc[("field_white", *cell)].sort_values("seed")
    assert list(kept.seed) == list(rows.seed)
    for column in ("position_rmse_m", "anees"):
        assert list(rows[column]) == pytest.approx(list(kept[column]), rel=1e-12)


@pytest.mark.parametrize("variant", ["ruts", "vibration", "headland", "combined"])
def test_a_preset_of_the_first_version_is_its_variant_but_for_the_sensors(variant):
    old, new = (choose("dataset", f"{name}_{variant}").plain for name in ("field_white", "field"))
    old, new = (vars(create("dataset", plain)) for plain in (old, new))
    assert {name for name in old if old[name] != new[name]} == COLOURED


def noise_of(seed, **changes):
    drive = Field(**changes).load(seed)
    truth = drive.reference
    rows = np.searchsorted(truth.t_s, drive.position.t_s - 1e-6)
    return drive, truth, rows


def test_a_share_of_the_noise_lasts_and_all_of_it_has_the_stated_variance():
    plain = {"position_latency_s": 0.0, "lever_arm_error_m": (0.0, 0.0, 0.0)}
    unit = []
    for seed in range(12):
        drive, truth, rows = noise_of(seed, **plain)
        unit.append((drive.position.enu_m - truth.enu_m[rows]) / Field().position_sigma_m)
    e = np.stack(unit)
    assert np.mean(e**2) == pytest.approx(1.0, abs=0.08)
    for lag_s in (0.2, 1.0, 5.0):
        k = round(lag_s * 5)
        assert np.mean(e[:, k:] * e[:, :-k]) == pytest.approx(0.7 * np.exp(-lag_s / 5.0), abs=0.08)


def test_a_fix_is_late_and_off_by_the_arm():
    drive, truth, rows = noise_of(0, noise=False, position_latency_s=0.25, lever_arm_error_m=(0.5, -0.2, 0.1))
    old = rows - 25
    there = old >= 0
    place = truth.enu_m[old] + dcm_from_euler(truth.euler_rad[old]) @ np.array([0.5, -0.2, 0.1])
    np.testing.assert_allclose(drive.position.enu_m[there], place[there], atol=1e-9)


def test_streams_are_apart():
    both, less = Field(duration_s=20.0).load(1), Field(duration_s=20.0, velocity_coloured_share=0.0).load(1)
    np.testing.assert_array_equal(both.position.enu_m, less.position.enu_m)
    np.testing.assert_array_equal(both.heading.yaw_rad, less.heading.yaw_rad)
    assert not np.array_equal(both.velocity.mps, less.velocity.mps)
    silent = Field(duration_s=20.0, silent=("position",), position_latency_s=0.0, lever_arm_error_m=(0, 0, 0)).load(1)
    rows = np.searchsorted(silent.reference.t_s, silent.position.t_s - 1e-6)
    np.testing.assert_allclose(silent.position.enu_m, silent.reference.enu_m[rows], atol=1e-12)


@pytest.mark.parametrize(
    "values",
    [
        {"position_coloured_share": 1.1},
        {"velocity_coloured_time_s": 0.0},
        {"position_latency_s": 0.005},
        {"position_latency_s": -0.01},
        {"lever_arm_error_m": (0.0, 0.0)},
    ],
)
def test_wrong_parameters_are_refused(values):
    with pytest.raises(PluginError):
        Field(**values)
