import numpy as np
import pytest

from jerkbench.errors import RecordingError
from jerkbench.io.frames import body_from_sensor, first_rest_s, scaled_to_gravity, without_gyro_bias
from jerkbench.recording import Imu

T_S = np.arange(400) * 0.01


def imu_at_rest(accel=(0.0, 6.0, 8.0), gyro=(0.01, -0.02, 0.03)):
    ripple = np.where(np.arange(400) % 2, 0.5, -0.5)[:, None]
    moving = (T_S >= 2.0)[:, None]
    return Imu(T_S, np.array(accel) + ripple + 5 * moving, np.array(gyro) + ripple + moving)


def test_the_rest_ends_a_second_before_the_first_motion():
    t_s = np.arange(40) * 0.25 - 1.0
    speed = np.where(t_s >= 5.0, 1.0, 0.02)
    assert first_rest_s(t_s, speed, 9.0) == 4.0
    assert first_rest_s(t_s, np.full(40, 0.02), 9.0) == 9.0
    assert first_rest_s(t_s, np.full(40, 3.0), 9.0) == 0.0


def test_only_the_rest_decides_about_bias_and_scale():
    imu = imu_at_rest()
    np.testing.assert_allclose(imu.gyro_radps - without_gyro_bias(imu, 2.0).gyro_radps, [[0.01, -0.02, 0.03]] * 400)
    scaled = scaled_to_gravity(imu, 2.0)  # |(0, 6, 8)| = 10
    np.testing.assert_allclose(scaled.accel_mps2, imu.accel_mps2 * 0.981, rtol=1e-12)


def test_without_rest_the_calibration_says_what_to_do():
    with pytest.raises(RecordingError, match="remove_gyro_bias"):
        without_gyro_bias(imu_at_rest(), 0.5)


@pytest.mark.parametrize("accel", [(0.0, 0.0, 1.01), (0.0, 0.0, 96.0), (0.0, 0.0, 0.0)])
def test_a_wrong_unit_is_noticed(accel):
    with pytest.raises(RecordingError, match="correct its unit"):
        scaled_to_gravity(imu_at_rest(accel), 2.0)


def test_the_body_sees_a_mounted_sensor_through_yaw_then_pitch_then_signs():
    yaw, pitch = np.radians([5.35, -6.79])
    cy, sy, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    yawed = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    pitched = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    expected = (yawed @ pitched).T @ np.diag([-1, -1, 1])
    np.testing.assert_allclose(body_from_sensor((-1.0, -1.0, 1.0), 5.35, -6.79), expected, atol=1e-15)
