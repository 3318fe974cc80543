import numpy as np
import pytest

from jerkbench.errors import RecordingError
from jerkbench.io.frames import body_from_sensor, scaled_to_gravity
from jerkbench.recording import Imu

T_S = np.arange(400) * 0.01


def imu_at_rest(accel=(0.0, 6.0, 8.0), gyro=(0.01, -0.02, 0.03)):
    ripple = np.where(np.arange(400) % 2, 0.5, -0.5)[:, None]
    moving = (T_S >= 2.0)[:, None]
    return Imu(T_S, np.array(accel) + ripple + 5 * moving, np.array(gyro) + ripple + moving)


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
