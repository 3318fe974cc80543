from dataclasses import replace

import numpy as np
import pytest

from jerkbench.datasets.field import FieldVibration, FieldWhite
from jerkbench.geometry import dcm_from_euler
from jerkbench.simulation.imu import perfect_imu, saturate
from jerkbench.simulation.truth import Truth

G = 9.81


def rodrigues(rotation_vector):
    """The rotation matrix, from the textbook formula."""
    angle = np.linalg.norm(rotation_vector)
    K = np.cross(rotation_vector / angle, np.eye(3)).T
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def test_gyro_integrates_to_the_true_attitude():
    truth = FieldVibration(duration_s=40.0).truth(1)
    _, gyro = perfect_imu(truth)
    true = dcm_from_euler(truth.euler_rad)
    attitude = true[300]
    for k, rate in enumerate(gyro[300:], start=301):
        attitude = attitude @ rodrigues(rate * 0.01)
        if k % 500 == 0:
            np.testing.assert_allclose(attitude, true[k], atol=1e-11)


def mean_specific_force(field):
    """Mean over each sample of 20 values of Omega' (a + g), from a truth that is 20 times finer."""
    fine = replace(field, imu_rate_hz=2000.0, sensor_rate_hz=2000.0).truth(3)
    acceleration = np.diff(fine.velocity_mps, axis=0) * 2000.0 + [0.0, 0.0, G]
    middle = 0.5 * (fine.euler_rad[1:] + fine.euler_rad[:-1])
    body = np.einsum("kji,kj->ki", dcm_from_euler(middle), acceleration)
    return body.reshape(-1, 20, 3).mean(axis=1)


@pytest.mark.parametrize("field", [FieldWhite(duration_s=30.0), FieldVibration(duration_s=30.0)])
def test_accelerometer_is_the_mean_of_the_body_s_specific_force_to_second_order(field):
    difference = perfect_imu(field.truth(3))[0] - mean_specific_force(field)
    assert np.sqrt((difference**2).mean()) < 2e-3  # a tenth of the sensor's noise
    assert np.abs(difference.mean(axis=0)).max() < 3e-4


def test_at_rest_on_a_slope_it_feels_gravity_alone():
    roll, pitch = 0.2, -0.1
    still = np.zeros((3, 3))
    force, gyro = perfect_imu(Truth(np.arange(3) / 100, still, still, np.tile([roll, pitch, 1.0], (3, 1))))
    expected = G * np.array([-np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)])
    np.testing.assert_allclose(force, [expected, expected], atol=1e-12)
    np.testing.assert_allclose(gyro, 0.0, atol=1e-12)


def test_turning_left_on_the_level_it_feels_the_centripetal_acceleration():
    t, v, w = np.arange(101) / 100, 2.0, 0.5
    circle = v * np.column_stack([np.cos(w * t), np.sin(w * t), 0 * t])
    force, gyro = perfect_imu(Truth(t, circle, circle, np.column_stack([0 * t, 0 * t, w * t])))
    np.testing.assert_allclose(force, np.tile([0.0, v * w, G], (100, 1)), atol=1e-5)
    np.testing.assert_allclose(gyro, np.tile([0.0, 0.0, w], (100, 1)), atol=1e-12)


def test_range_cuts_off_before_the_mean():
    force = np.array([[0.0, 0.0, 10.0]])
    false = np.array([[[0.0, -60.0, 0.0], [0.0, 0.0, 45.0]]])
    np.testing.assert_allclose(saturate(force, false, 4.0), [[0.0, -4 * G / 2, (10.0 + 4 * G) / 2]])
    np.testing.assert_allclose(saturate(force, false, None), [[0.0, -30.0, 32.5]])
    np.testing.assert_allclose(saturate(force * 10, None, 4.0), [[0.0, 0.0, 4 * G]])
