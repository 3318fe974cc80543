"""The simulated IMU: samples, noise and systematic errors."""

from dataclasses import replace

import numpy as np
import pytest

from jerkbench.datasets.field import FieldVibration, FieldWhite
from jerkbench.geometry import dcm_from_euler
from jerkbench.simulation.sensors import GRADES, SensorErrors, perfect_imu, saturate, with_sensor_errors
from jerkbench.simulation.truth import Truth

G = 9.81


def mean_specific_force(field):
    """Mean of 20 values of Omega' (a + g) over each sample, from a truth with 20 times the rate."""
    fine = replace(field, imu_rate_hz=2000.0, sensor_rate_hz=2000.0).truth(3)
    acceleration = np.diff(fine.velocity_mps, axis=0) * 2000.0 + [0.0, 0.0, G]
    middle = 0.5 * (fine.euler_rad[1:] + fine.euler_rad[:-1])
    body = np.einsum("kji,kj->ki", dcm_from_euler(middle), acceleration)
    return body.reshape(-1, 20, 3).mean(axis=1)


@pytest.mark.parametrize("field", [FieldWhite(duration_s=30.0), FieldVibration(duration_s=30.0)])
def test_accelerometer_is_the_mean_of_the_body_s_specific_force_to_second_order(field):
    difference = perfect_imu(field.truth(3))[0] - mean_specific_force(field)
    assert np.sqrt((difference**2).mean()) < 2e-3  # a tenth of the noise of the sensor
    assert np.abs(difference.mean(axis=0)).max() < 3e-4


def test_at_rest_on_a_slope_and_in_a_level_turn_it_measures_gravity_and_the_centripetal_acceleration():
    roll, pitch = 0.2, -0.1
    still = np.zeros((3, 3))
    force, gyro = perfect_imu(Truth(np.arange(3) / 100, still, still, np.tile([roll, pitch, 1.0], (3, 1))))
    expected = G * np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])
    np.testing.assert_allclose(force, [expected, expected], atol=1e-12)
    np.testing.assert_allclose(gyro, 0.0, atol=1e-12)
    t, v, w = np.arange(101) / 100, 2.0, 0.5
    circle = v * np.column_stack([np.cos(w * t), np.sin(w * t), 0 * t])
    force, gyro = perfect_imu(Truth(t, circle, circle, np.column_stack([0 * t, 0 * t, w * t])))
    np.testing.assert_allclose(force, np.tile([0.0, v * w, G], (100, 1)), atol=1e-5)
    np.testing.assert_allclose(gyro, np.tile([0.0, 0.0, w], (100, 1)), atol=1e-12)


def test_the_range_limits_before_the_mean():
    force = np.array([[0.0, 0.0, 10.0]])
    false = np.array([[[0.0, -60.0, 0.0], [0.0, 0.0, 45.0]]])
    np.testing.assert_allclose(saturate(force, false, 4.0), [[0.0, -4 * G / 2, (10.0 + 4 * G) / 2]])
    np.testing.assert_allclose(saturate(force, false, None), [[0.0, -30.0, 32.5]])
    np.testing.assert_allclose(saturate(force * 10, None, 4.0), [[0.0, 0.0, 4 * G]])


STILL = np.zeros((20000, 3))


def allan(rate, interval, cluster):
    """Allan deviation of the rows for one cluster length, by its definition."""
    m = round(cluster / interval)
    means = rate[: len(rate) // m * m].reshape(-1, m).mean(axis=1)
    return np.sqrt(0.5 * np.mean(np.diff(means) ** 2))


def test_white_noise_integrates_to_the_random_walks_of_the_data_sheet():
    sheet = GRADES["tactical"].gyro(100.0)
    noise = with_sensor_errors(STILL, SensorErrors(sheet.noise), 0.01, 1, "gyro")
    one_second = np.degrees(np.mean([allan(axis, 0.01, 1.0) for axis in noise.T]))
    assert one_second * 60 == pytest.approx(0.15, rel=0.08)  # deg/sqrt(h)
    sheet = GRADES["tactical"].accelerometer(100.0)
    noise = with_sensor_errors(STILL, SensorErrors(sheet.noise), 0.01, 1, "accelerometer")
    assert np.mean([allan(axis, 0.01, 1.0) for axis in noise.T]) * 60 == pytest.approx(0.06, rel=0.08)


def test_conversion_of_data_sheet_units():
    gyro, accel = GRADES["tactical"].gyro(100.0), GRADES["tactical"].accelerometer(100.0)
    assert gyro.turn_on == pytest.approx(10 / 206264.806, rel=1e-6)  # 1 deg/h is one arc second per second
    assert gyro.wander == pytest.approx(0.5 / 206264.806 / 0.664, rel=1e-6)
    assert accel.turn_on == pytest.approx(0.75 * 9.81e-3)
    assert accel.wander == pytest.approx(0.05 * 9.81e-3 / 0.664)
    assert (gyro.scale, accel.scale, gyro.misalignment_rad) == pytest.approx((500e-6, 300e-6, 1e-3))


def test_biases_over_seeds():
    """A bias wanders or is constant; the scale is on the diagonal and the misalignment off it."""
    ends = np.array(
        [with_sensor_errors(np.zeros((101, 3)), SensorErrors(0.0, wander=2.0), 1.0, s, "gyro") for s in range(500)]
    )
    start, end = ends[:, 0].ravel(), ends[:, -1].ravel()
    assert start.std() == pytest.approx(2.0, rel=0.1)
    assert end.std() == pytest.approx(2.0, rel=0.1)
    assert np.corrcoef(start, end)[0, 1] == pytest.approx(np.exp(-1), abs=0.1)
    biases = np.array(
        [with_sensor_errors(STILL[:3], SensorErrors(0.0, turn_on=0.5), 0.01, s, "gyro") for s in range(500)]
    )
    assert np.ptp(biases, axis=1).max() == 0
    assert biases[:, 0].std() == pytest.approx(0.5, rel=0.1)
    matrices = np.array(
        [with_sensor_errors(np.eye(3), SensorErrors(0.0, 0.0, 0.0, 0.1, 0.01), 1, s, "a") for s in range(500)]
    )
    errors = matrices.transpose(0, 2, 1) - np.eye(3)
    diagonal = np.eye(3, dtype=bool)
    assert errors[:, diagonal].std() == pytest.approx(0.1, rel=0.1)
    assert errors[:, ~diagonal].std() == pytest.approx(0.01, rel=0.1)
