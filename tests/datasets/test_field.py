from dataclasses import replace

import numpy as np
import pytest

from jerkbench.datasets.field import Field, FieldHeadland, FieldRuts, FieldVibration, FieldWhite
from jerkbench.errors import PluginError
from jerkbench.geometry import dcm_from_euler
from jerkbench.plugins import create

FIELDS = {
    "field": Field,
    "field_white": FieldWhite,
    "field_ruts": FieldRuts,
    "field_vibration": FieldVibration,
    "field_headland": FieldHeadland,
}
PERFECT = {"noise": False, "false_forces": False, "accel_range_g": None}
G = np.array([0.0, 0.0, 9.81])


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


@pytest.mark.parametrize("name", FIELDS)
def test_integrating_the_imu_returns_the_true_velocity_and_position(name):
    recording = create("dataset", {"name": name, **PERFECT}).load(2)
    reference = recording.reference
    dcm, v, p = dcm_from_euler(reference.euler_rad), reference.velocity_mps[0], reference.enu_m[0]
    for k in range(1, len(reference.t_s)):
        u = 0.5 * (dcm[k - 1] + dcm[k]) @ recording.imu.accel_mps2[k] - G
        p = p + 0.01 * v + 0.5 * 0.01**2 * u
        v = v + 0.01 * u
    np.testing.assert_allclose(v, reference.velocity_mps[-1], rtol=0, atol=1e-3)
    np.testing.assert_allclose(p, reference.enu_m[-1], rtol=0, atol=1e-3)


def test_stamps_coincide_exactly(drive):
    np.testing.assert_array_equal(drive.imu.t_s, np.arange(1, 15001) / 100)
    np.testing.assert_array_equal(drive.reference.t_s, drive.imu.t_s)
    for measured in (drive.position, drive.velocity, drive.heading):
        np.testing.assert_array_equal(measured.t_s, drive.imu.t_s[19::20])


def test_a_thinned_reference_keeps_rows_of_the_full_one(drive):
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


def test_imu_noise_has_its_sigma(drive):
    clean = FieldWhite(noise=False).load(1)
    for name, sigma in (("accelerometer", 0.02), ("gyro", 0.0017)):
        noise = imu_arrays(drive)[name] - imu_arrays(clean)[name]
        np.testing.assert_allclose(noise.std(axis=0), sigma, rtol=0.03)
        np.testing.assert_allclose(noise.mean(axis=0), 0.0, atol=4 * sigma / np.sqrt(15000))


def test_measurement_noise_has_the_sigma_that_is_reported(drive):
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


def test_without_noise_every_sensor_says_the_truth():
    recording = FieldWhite(noise=False).load(1)
    np.testing.assert_array_equal(recording.position.enu_m, recording.reference.enu_m[19::20])
    np.testing.assert_array_equal(recording.velocity.mps, recording.reference.velocity_mps[19::20])
    np.testing.assert_allclose(recording.heading.yaw_rad, recording.reference.euler_rad[19::20, 2], atol=1e-12)


def test_headings_are_wrapped(drive):
    assert np.abs(drive.heading.yaw_rad).max() <= np.pi
    assert np.abs(drive.reference.euler_rad[:, 2]).max() <= np.pi
    turns = (FieldWhite().truth(1).euler_rad[1:, 2] - drive.reference.euler_rad[:, 2]) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-12)
    assert set(np.round(turns)) == {0.0, 1.0}


def test_a_seed_is_one_recording():
    short = FieldWhite(duration_s=20.0)
    assert changed(short.load(5), short.load(5)) == set()
    assert changed(short.load(5), short.load(6)) == {*sensors(short.load(5))}


@pytest.mark.parametrize(
    ("switch", "moves"),
    [
        ({"accel_sigma_mps2": 0.0}, {"accelerometer"}),
        ({"gyro_sigma_radps": 0.0}, {"gyro"}),
        ({"position_sigma_m": (1.0, 1.0, 1.0)}, {"position"}),
        ({"velocity_sigma_mps": (1.0, 1.0, 1.0)}, {"velocity"}),
        ({"heading_sigma_rad": 0.1}, {"heading"}),
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


def test_a_silent_sensor_is_still_believed_as_before():
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


def test_no_sample_is_beyond_the_range():
    accel = FieldVibration().load(4).imu.accel_mps2
    assert accel.max() == pytest.approx(4 * 9.81)


def test_tilt_is_gentle_and_not_made_by_short_waves():
    recording = FieldWhite(noise=False).load(1)
    tilt = recording.reference.euler_rad[600:, :2]
    assert (tilt.std(axis=0) < 0.06).all()
    assert (tilt.std(axis=0) > 0.01).all()
    slow = np.fft.rfft(tilt, axis=0)[np.fft.rfftfreq(len(tilt), 0.01) < 1.0]
    assert (2 * np.abs(slow[1:] / len(tilt)) ** 2).sum() > 0.9 * tilt.var(axis=0).sum()


def test_pitch_follows_the_climb_and_is_positive_nose_down():
    recording = FieldWhite(noise=False, vibration_mps2=0.0, vibration_rad=0.0).load(1)
    velocity = recording.reference.velocity_mps[1000:]
    climb = np.arctan(velocity[:, 2] / np.hypot(velocity[:, 0], velocity[:, 1]))
    np.testing.assert_allclose(recording.reference.euler_rad[1000:, 1], -climb, atol=1e-9)


def test_roll_lifts_the_left_side_where_the_hill_is_on_the_left():
    north = FieldWhite(duration_s=10.0, roughness=0.0, vibration_rad=0.0, vibration_mps2=0.0, heading_rad=np.pi / 2)
    roll = north.load(0).reference.euler_rad[0, 0]
    assert roll == pytest.approx(-np.arctan(0.4 * 2 * np.pi / 60))  # driving north, the hill rises to the right


@pytest.mark.parametrize(
    ("parameter", "sentence"),
    [
        ({"imu": "tacticle"}, "Did you mean 'tactical'"),
        ({"gnss_rate_hz": 7.0}, "whole multiple"),
        ({"reference_rate_hz": 200.0}, "whole multiple"),
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
    ],
)
def test_a_value_that_makes_no_sense_is_one_sentence(parameter, sentence):
    with pytest.raises(PluginError, match="dataset field") as error:
        FieldWhite(**parameter)
    assert sentence in str(error.value)
