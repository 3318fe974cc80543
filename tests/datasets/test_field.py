"""The simulated field and its versions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from jerkbench import run
from jerkbench.datasets.field import Field, FieldVibration, FieldWhite
from jerkbench.errors import PluginError
from jerkbench.geometry import dcm_from_euler
from jerkbench.jobs.names import choose
from jerkbench.jobs.study import load_study
from jerkbench.plugins import create
from synthetic import integrated


@pytest.fixture(scope="module")
def drive():
    return FieldWhite().load(1)


def imu_arrays(recording):
    return {"accelerometer": recording.imu.accel_mps2, "gyro": recording.imu.gyro_radps}


def sensors(recording):
    return {
        **imu_arrays(recording),
        "position": recording.position.enu_m,
        "velocity": recording.velocity.mps,
        "heading": recording.heading.yaw_rad,
        "truth": recording.reference.enu_m,
    }


def changed(one, other):
    a, b = sensors(one), sensors(other)
    return {name for name in a if not np.array_equal(a[name], b[name])}


@pytest.mark.parametrize("name", ["field", "field_white", "field_ruts", "field_vibration", "field_headland"])
def test_integrating_the_imu_returns_the_true_velocity_and_position(name):
    recording = create("dataset", {"name": name, "noise": False, "false_forces": False, "accel_range_g": None}).load(2)
    p, v = integrated(recording)
    np.testing.assert_allclose(v, recording.reference.velocity_mps[-1], rtol=0, atol=1e-3)
    np.testing.assert_allclose(p, recording.reference.enu_m[-1], rtol=0, atol=1e-3)


def test_stamps_coincide_exactly_and_a_thinned_reference_keeps_its_rows(drive):
    np.testing.assert_array_equal(drive.imu.t_s, np.arange(1, 15001) / 100)
    np.testing.assert_array_equal(drive.reference.t_s, drive.imu.t_s)
    for measured in (drive.position, drive.velocity, drive.heading):
        np.testing.assert_array_equal(measured.t_s, drive.imu.t_s[19::20])
    thin = FieldWhite(reference_rate_hz=10.0).load(1).reference
    np.testing.assert_array_equal(thin.t_s, drive.reference.t_s[9::10])
    np.testing.assert_array_equal(thin.enu_m, drive.reference.enu_m[9::10])


def test_it_stands_still_at_the_start():
    recording = FieldWhite(noise=False, duration_s=10.0).load(3)
    rest = recording.imu.t_s <= recording.static_start_s
    assert rest.sum() == 300
    assert np.ptp(recording.reference.enu_m[rest], axis=0).max() == 0
    assert np.ptp(recording.reference.euler_rad[rest], axis=0).max() == 0
    assert np.ptp(recording.imu.accel_mps2[rest], axis=0).max() < 1e-12
    np.testing.assert_allclose(np.linalg.norm(recording.imu.accel_mps2[rest], axis=1), 9.81)
    np.testing.assert_allclose(recording.imu.gyro_radps[rest], 0.0, atol=1e-12)


def test_noise_has_the_sigma_that_is_reported_and_headings_are_wrapped(drive):
    clean = FieldWhite(noise=False).load(1)
    for name, sigma in (("accelerometer", 0.02), ("gyro", 0.0017)):
        noise = imu_arrays(drive)[name] - imu_arrays(clean)[name]
        np.testing.assert_allclose(noise.std(axis=0), sigma, rtol=0.03)
        np.testing.assert_allclose(noise.mean(axis=0), 0.0, atol=4 * sigma / np.sqrt(15000))
    rows = np.searchsorted(drive.reference.t_s, drive.position.t_s)
    position = drive.position.enu_m - drive.reference.enu_m[rows]
    velocity = drive.velocity.mps - drive.reference.velocity_mps[rows]
    heading = drive.heading.yaw_rad - drive.reference.euler_rad[rows, 2]
    heading = np.arctan2(np.sin(heading), np.cos(heading))
    np.testing.assert_allclose(position.std(axis=0), [0.01, 0.01, 0.02], rtol=0.12)
    np.testing.assert_allclose(velocity.std(axis=0), [0.03, 0.03, 0.06], rtol=0.12)
    assert heading.std() == pytest.approx(0.0087, rel=0.12)
    np.testing.assert_allclose(drive.position.covariance_m2[7], np.diag([1e-4, 1e-4, 4e-4]))
    np.testing.assert_allclose(drive.velocity.covariance_m2ps2[7], np.diag([9e-4, 9e-4, 36e-4]))
    np.testing.assert_allclose(drive.heading.sigma_rad, 0.0087)
    assert drive.position.true_covariance_m2 is None
    assert np.abs(drive.heading.yaw_rad).max() <= np.pi
    assert np.abs(drive.reference.euler_rad[:, 2]).max() <= np.pi
    turns = (FieldWhite().truth(1).euler_rad[1:, 2] - drive.reference.euler_rad[:, 2]) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-12)
    assert set(np.round(turns)) == {0.0, 1.0}


def test_without_noise_every_sensor_says_the_truth():
    recording = FieldWhite(noise=False).load(1)
    np.testing.assert_array_equal(recording.position.enu_m, recording.reference.enu_m[19::20])
    np.testing.assert_array_equal(recording.velocity.mps, recording.reference.velocity_mps[19::20])
    np.testing.assert_allclose(recording.heading.yaw_rad, recording.reference.euler_rad[19::20, 2], atol=1e-12)


@pytest.mark.parametrize(
    ("switch", "moves"),
    [
        ({"accel_sigma_mps2": 0.0}, {"accelerometer"}),
        ({"gyro_sigma_radps": 0.0}, {"gyro"}),
        ({"position_sigma_m": (1.0, 1.0, 1.0)}, {"position"}),
        ({"velocity_sigma_mps": (1.0, 1.0, 1.0)}, {"velocity"}),
        ({"heading_sigma_rad": 0.1}, {"heading"}),
        ({"velocity_coloured_share": 0.5}, {"velocity"}),
        ({"impacts_per_s": 3.0}, {"accelerometer"}),
        ({"accel_range_g": 1.0}, {"accelerometer"}),
        ({"imu": "tactical"}, {"accelerometer", "gyro"}),
        *(({"silent": (name,)}, {name}) for name in ("accelerometer", "gyro", "position", "velocity", "heading")),
        ({"silent": ("position", "gyro")}, {"position", "gyro"}),
        ({"silent": ("impacts",)}, set()),  # it has none
    ],
)
def test_switching_one_source_does_not_move_the_others(switch, moves):
    short = FieldWhite(duration_s=12.0)
    assert changed(short.load(1), replace(short, **switch).load(1)) == moves


def test_a_silent_source_is_one_without_size():
    short = replace(FieldWhite(duration_s=12.0), impacts_per_s=3.0)
    sizes = {
        "terrain": {"roughness": 0.0},
        "vibration": {"vibration_mps2": 0.0, "vibration_rad": 0.0},
        "impacts": {"impacts_per_s": 0.0},
    }
    for name, size in sizes.items():
        silent = replace(short, silent=(name,)).load(1)
        assert changed(silent, replace(short, **size).load(1)) == set()
        assert "accelerometer" in changed(silent, short.load(1))


def test_a_silent_sensor_is_still_believed_as_before_and_has_no_slow_error_either():
    silent = Field(duration_s=20.0, silent=("position",), position_latency_s=0.0, lever_arm_error_m=(0, 0, 0)).load(1)
    rows = np.searchsorted(silent.reference.t_s, silent.position.t_s - 1e-6)
    np.testing.assert_allclose(silent.position.enu_m, silent.reference.enu_m[rows], atol=1e-12)
    one, other = FieldWhite(duration_s=12.0).load(1), FieldWhite(duration_s=12.0, silent=("position",)).load(1)
    np.testing.assert_array_equal(one.position.covariance_m2, other.position.covariance_m2)
    with pytest.raises(PluginError, match="mean 'position'"):
        FieldWhite(silent=("positon",))


def test_switching_false_forces_off_changes_the_accelerometer_after_the_ramp_only():
    with_them, without = FieldVibration().load(4), FieldVibration(false_forces=False).load(4)
    assert changed(with_them, without) == {"accelerometer"}
    difference = with_them.imu.accel_mps2 - without.imu.accel_mps2
    assert np.abs(difference[:, :2]).max() < 1e-12
    where = np.flatnonzero(difference[:, 2] > 1e-9)
    assert with_them.imu.t_s[where[0]] > 6.0
    assert 20 <= (np.diff(where) > 1).sum() <= 70  # 43 impacts are expected
    accel = FieldVibration().load(4).imu.accel_mps2
    assert accel.max() == pytest.approx(4 * 9.81)


def test_tilt_is_gentle_and_not_made_by_short_waves():
    recording = FieldWhite(noise=False).load(1)
    tilt = recording.reference.euler_rad[600:, :2]
    assert (tilt.std(axis=0) < 0.06).all()
    assert (tilt.std(axis=0) > 0.01).all()
    slow = np.fft.rfft(tilt, axis=0)[np.fft.rfftfreq(len(tilt), 0.01) < 1.0]
    assert (2 * np.abs(slow[1:] / len(tilt)) ** 2).sum() > 0.9 * tilt.var(axis=0).sum()


def test_pitch_follows_the_climb_and_roll_the_hill():
    recording = FieldWhite(noise=False, vibration_mps2=0.0, vibration_rad=0.0).load(1)
    velocity = recording.reference.velocity_mps[1000:]
    climb = np.arctan(velocity[:, 2] / np.hypot(velocity[:, 0], velocity[:, 1]))
    np.testing.assert_allclose(recording.reference.euler_rad[1000:, 1], -climb, atol=1e-9)
    north = FieldWhite(duration_s=10.0, roughness=0.0, vibration_rad=0.0, vibration_mps2=0.0, heading_rad=np.pi / 2)
    roll = north.load(0).reference.euler_rad[0, 0]
    assert roll == pytest.approx(-np.arctan(0.4 * 2 * np.pi / 60))  # driving north, the hill rises to the right


@pytest.mark.parametrize(
    ("parameter", "sentence"),
    [
        ({"imu": "tacticle"}, "Did you mean 'tactical'"),
        ({"gnss_rate_hz": 7.0}, "integer multiple"),
        ({"reference_rate_hz": 200.0}, "integer multiple"),
        ({"speed_mps": 0.0}, "speed_mps is 0.0; it must be a positive number"),
        ({"duration_s": float("nan")}, "duration_s"),
        ({"roughness": -1.0}, "roughness is -1.0; it must be zero or positive"),
        ({"position_sigma_m": (0.01, 0.01)}, "position_sigma_m"),
        ({"velocity_sigma_mps": (0.01, 0.01, 0.0)}, "velocity_sigma_mps"),
        ({"rut_force_mps2": (1.0,)}, "rut_force_mps2"),
        ({"accel_range_g": 0.0}, "accel_range_g"),
        ({"pass_s": 3.0}, "pass_s"),
        ({"duration_s": 0.1}, "duration_s"),
        ({"ruts": True, "rut_times_s": (1.0,)}, "rut_times_s"),
        ({"position_coloured_share": 1.1}, "position_coloured_share is 1.1"),
        ({"velocity_coloured_time_s": 0.0}, "velocity_coloured_time_s is 0.0"),
        ({"position_latency_s": 0.005}, "position_latency_s"),
        ({"position_latency_s": -0.01}, "position_latency_s is -0.01"),
        ({"lever_arm_error_m": (0.0, 0.0)}, "lever_arm_error_m"),
    ],
)
def test_a_value_that_makes_no_sense_is_one_sentence(parameter, sentence):
    with pytest.raises(PluginError, match="dataset field") as error:
        FieldWhite(**parameter)
    assert sentence in str(error.value)


GOLDEN = {
    ("rtk_float", "jerk", "none"): (0.39495630160870465, 82.93338718997019),
    ("wheel_slip", "jerk", "sage_husa"): (0.018802518696758343, 5.591112110042042),
    ("outliers", "jerk", "chi2"): (0.015676376958248465, 4.325723156798601),
}
"""RMSE [m] and ANEES of seed 0 over 60 s, from the code before there was a second version."""

COLOURED = {name for name, value in vars(FieldWhite()).items() if value != vars(Field())[name]}
"""The parameters by which the versions differ."""

COMMITTED = {("none", "jerk", "none"): "0.0162", ("multipath_single_axis", "baseline", "mtf"): "0.0234"}
"""Cells of the first published table: arithmetic means of 20 seeds."""


@pytest.mark.parametrize("cell", GOLDEN)
def test_old_numbers_stay(cell):
    disturbance, model, adaptation = cell
    dataset = {"name": "field_white", "duration_s": 60.0}
    row = run(dataset=dataset, disturbance=disturbance, filter=model, adaptation=adaptation, seeds=1).iloc[0]
    assert (row.position_rmse_m, row.anees) == pytest.approx(GOLDEN[cell], rel=1e-12)


@pytest.mark.parametrize("cell", COMMITTED)
def test_the_committed_rows_are_those_of_the_first_version(cell):
    disturbance, model, adaptation = cell
    rows = run(dataset="field_white", disturbance=disturbance, filter=model, adaptation=adaptation, seeds=2)
    kept = (
        load_study(Path(__file__).parents[2] / "results" / "paper20")
        .rows.set_index(["dataset", "disturbance", "filter", "adaptation"])
        .sort_index()
    )
    kept = kept.loc[("field_white", *cell)].set_index("seed")
    assert f"{kept.position_rmse_m.mean():.4f}" == COMMITTED[cell]
    for column in ("position_rmse_m", "anees"):
        assert list(rows[column]) == pytest.approx(list(kept[column][rows.seed]), rel=1e-12)


def test_a_preset_of_the_first_version_is_its_variant_but_for_the_sensors():
    old, new = (choose("dataset", f"{name}_ruts").plain for name in ("field_white", "field"))
    old, new = (vars(create("dataset", plain)) for plain in (old, new))
    assert {name for name in old if old[name] != new[name]} == COLOURED


def noise_of(seed, **changes):
    drive = Field(**changes).load(seed)
    truth = drive.reference
    rows = np.searchsorted(truth.t_s, drive.position.t_s - 1e-6)
    return drive, truth, rows


def test_a_share_of_the_noise_lasts_and_a_fix_is_late_and_off_by_the_arm():
    plain = {"position_latency_s": 0.0, "lever_arm_error_m": (0.0, 0.0, 0.0)}
    unit = {"position": [], "velocity": []}
    for seed in range(12):
        drive, truth, rows = noise_of(seed, **plain)
        unit["position"].append((drive.position.enu_m - truth.enu_m[rows]) / Field().position_sigma_m)
        unit["velocity"].append((drive.velocity.mps - truth.velocity_mps[rows]) / Field().velocity_sigma_mps)
    for name, share, time_s in (("position", 0.7, 5.0), ("velocity", 0.5, 2.0)):
        e = np.stack(unit[name])
        assert np.mean(e**2) == pytest.approx(1.0, abs=0.08)
        for lag_s in (0.2, 1.0, 5.0):
            k = round(lag_s * 5)
            assert np.mean(e[:, k:] * e[:, :-k]) == pytest.approx(share * np.exp(-lag_s / time_s), abs=0.08)
    drive, truth, rows = noise_of(0, noise=False, position_latency_s=0.25, lever_arm_error_m=(0.5, -0.2, 0.1))
    old = rows - 25
    there = old >= 0
    place = truth.enu_m[old] + dcm_from_euler(truth.euler_rad[old]) @ np.array([0.5, -0.2, 0.1])
    np.testing.assert_allclose(drive.position.enu_m[there], place[there], atol=1e-9)
