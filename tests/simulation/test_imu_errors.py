import numpy as np
import pytest

from jerkbench.simulation.imu import GRADES, SensorErrors, with_sensor_errors

STILL = np.zeros((20000, 3))


def allan(rate, interval, cluster):
    """Allan deviation of rows at one cluster length, from its definition."""
    m = round(cluster / interval)
    means = rate[: len(rate) // m * m].reshape(-1, m).mean(axis=1)
    return np.sqrt(0.5 * np.mean(np.diff(means) ** 2))


def test_white_noise_integrates_to_the_angle_random_walk_of_the_data_sheet():
    sheet = GRADES["tactical"].gyro(100.0)
    noise = with_sensor_errors(STILL, SensorErrors(sheet.noise), 0.01, 1, "gyro")
    one_second = np.degrees(np.mean([allan(axis, 0.01, 1.0) for axis in noise.T]))
    assert one_second * 60 == pytest.approx(0.15, rel=0.08)  # deg/sqrt(h)


def test_white_noise_integrates_to_the_velocity_random_walk_of_the_data_sheet():
    sheet = GRADES["tactical"].accelerometer(100.0)
    noise = with_sensor_errors(STILL, SensorErrors(sheet.noise), 0.01, 1, "accelerometer")
    assert np.mean([allan(axis, 0.01, 1.0) for axis in noise.T]) * 60 == pytest.approx(0.06, rel=0.08)


def test_data_sheet_units_by_hand():
    gyro, accel = GRADES["tactical"].gyro(100.0), GRADES["tactical"].accelerometer(100.0)
    assert gyro.turn_on == pytest.approx(10 / 206264.806, rel=1e-6)  # deg/h: one second of arc a second
    assert gyro.wander == pytest.approx(0.5 / 206264.806 / 0.664, rel=1e-6)
    assert accel.turn_on == pytest.approx(0.75 * 9.81e-3)
    assert accel.wander == pytest.approx(0.05 * 9.81e-3 / 0.664)
    assert (gyro.scale, accel.scale, gyro.misalignment_rad) == pytest.approx((500e-6, 300e-6, 1e-3))


def test_a_wandering_bias_is_stationary_and_correlated_over_100_s():
    ends = np.array(
        [with_sensor_errors(np.zeros((101, 3)), SensorErrors(0.0, wander=2.0), 1.0, s, "gyro") for s in range(500)]
    )
    start, end = ends[:, 0].ravel(), ends[:, -1].ravel()
    assert start.std() == pytest.approx(2.0, rel=0.1)
    assert end.std() == pytest.approx(2.0, rel=0.1)
    assert np.corrcoef(start, end)[0, 1] == pytest.approx(np.exp(-1), abs=0.1)


def test_a_turn_on_bias_is_one_constant_for_each_axis_and_seed():
    biases = np.array(
        [with_sensor_errors(STILL[:3], SensorErrors(0.0, turn_on=0.5), 0.01, s, "gyro") for s in range(500)]
    )
    assert np.ptp(biases, axis=1).max() == 0
    assert biases[:, 0].std() == pytest.approx(0.5, rel=0.1)


def test_scale_and_misalignment_are_the_diagonal_and_the_rest():
    matrices = np.array(
        [with_sensor_errors(np.eye(3), SensorErrors(0.0, 0.0, 0.0, 0.1, 0.01), 1, s, "a") for s in range(500)]
    )
    errors = matrices.transpose(0, 2, 1) - np.eye(3)
    diagonal = np.eye(3, dtype=bool)
    assert errors[:, diagonal].std() == pytest.approx(0.1, rel=0.1)
    assert errors[:, ~diagonal].std() == pytest.approx(0.01, rel=0.1)
