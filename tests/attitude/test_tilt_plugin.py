from dataclasses import replace
from pathlib import Path

import moved
import numpy as np
import pytest
from moved import G, standing
from omegaconf import OmegaConf

from jerkbench.attitude.common import TiltStart, tilt_start
from jerkbench.attitude.tilt import Tilt
from jerkbench.errors import RecordingError
from jerkbench.geometry import dcm_from_euler
from jerkbench.plugins import create
from jerkbench.recording import Heading, Imu, Recording, Reference, Velocity

PRESETS = Path(__file__).parents[2] / "conf" / "attitude"


def recording(accel, gyro=None, static_start_s=2.0, **parts):
    return moved.recording(np.zeros((len(accel), 3)) if gyro is None else gyro, accel, static_start_s, **parts)


def test_a_robot_at_rest_on_a_slope():
    heading = Heading([0.1, 1.0], [2.0, 2.0], [0.01, 0.01])
    attitude = Tilt().estimate(recording(standing([0.1, -0.2, 0.0]), heading=heading))
    np.testing.assert_allclose(attitude.euler_rad, np.tile([0.1, -0.2, 2.0], (300, 1)), atol=1e-12)
    np.testing.assert_allclose(attitude.dcm, dcm_from_euler(attitude.euler_rad), atol=1e-15)
    np.testing.assert_allclose(attitude.accel_enu_mps2, 0, atol=1e-11)
    assert not attitude.triggered.any()
    assert attitude.t_s.shape == (300,)


def test_a_circle_on_a_level_field():
    # A constant speed of 2 m/s and 0.4 rad/s to the left give 0.8 m/s2 to the left while the robot moves.
    n, speed, rate = 1000, 2.0, 0.4
    t = 0.01 * np.arange(1, n + 1)
    accel = np.tile([0.0, speed * rate, G], (n, 1))
    velocity = Velocity(t, speed * np.column_stack([np.cos(rate * t), np.sin(rate * t), 0 * t]), [1e-4 * np.eye(3)] * n)
    circle = recording(accel, np.tile([0.0, 0.0, rate], (n, 1)), static_start_s=0.0, velocity=velocity)
    attitude = Tilt(initial_tilt_variance=1e-8).estimate(circle)
    yaw = attitude.euler_rad[:, 2]
    np.testing.assert_allclose(np.cos(yaw - rate * t), 1, atol=1e-9)
    # Midpoint: the mean of the acceleration over the sample, a = v rate (-sin, cos) of the middle's yaw.
    middle = rate * (t - 0.005)
    expected = speed * rate * np.column_stack([-np.sin(middle), np.cos(middle)])
    np.testing.assert_allclose(attitude.accel_enu_mps2[1:, :2], expected[1:], atol=0.02)
    assert attitude.triggered.all()


def test_an_irregular_interval_is_used_with_its_length():
    imu = Imu([0.0, 0.01, 0.05, 0.06], np.tile([0.0, 0.0, G], (4, 1)), np.tile([0.0, 0.0, 1.0], (4, 1)))
    attitude = Tilt().estimate(Recording("gap", imu, Reference([0.06], "made up", independent=True)))
    np.testing.assert_allclose(np.diff(attitude.euler_rad[:, 2]), [0.01, 0.04, 0.01], atol=1e-12)


def test_a_start_at_rest_uses_the_first_second_and_a_start_in_motion_is_level():
    accel = standing([0.0, 0.0, 0.0], 300)
    accel[:100] = standing([0.1, 0.2, 0.0], 100) + 0.1 * np.random.default_rng(0).normal(size=(100, 3))
    start = tilt_start(recording(accel), None)
    mean = accel[:100].mean(axis=0)
    np.testing.assert_allclose(start.x, mean / np.linalg.norm(mean), atol=1e-15)
    assert start.variance == 1e-3
    start = tilt_start(recording(standing([0.1, 0.2, 0.0]), static_start_s=0.9), None)
    np.testing.assert_array_equal(start.x, [0, 0, 1])
    assert start.variance == 0.03
    assert tilt_start(recording(standing([0, 0, 0])), 0.5).variance == 0.5
    with pytest.raises(RecordingError, match=r"moved.* zero"):
        Tilt().estimate(recording(np.zeros((300, 3))))


def yaw_at_the_end(**parameters):
    """Yaw of a level recording with two headings and two courses; the slow course points to the south."""
    heading = Heading([0.5, 1.5], [0.0, 1.0], [0.1, 0.1])
    covariance = np.diag([0.04, 0.04, 1.0])
    velocity = Velocity([0.5, 1.0, 1.5], [[2.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, -1.0, 0.0]], [covariance] * 3)
    level = recording(standing([0, 0, 0]), heading=heading, velocity=velocity)
    return Tilt(**parameters).estimate(level).euler_rad[-1, 2]


def test_the_yaw_parameters_are_passed_to_the_yaw_filter():
    # Without walk two equal sigmas average; with walk w over 1 s the second weighs (1 + w^2/s^2)/(2 + w^2/s^2).
    assert yaw_at_the_end(yaw_walk_rad_per_sqrt_s=0.0) == pytest.approx(0.5)
    assert yaw_at_the_end(yaw_walk_rad_per_sqrt_s=0.1) == pytest.approx(2 / 3)
    assert yaw_at_the_end(yaw_source="gyro_only") == pytest.approx(0.0)
    course = {"yaw_source": "course", "yaw_walk_rad_per_sqrt_s": 0.0, "course_min_speed_mps": 1.0}
    assert yaw_at_the_end(**course) == pytest.approx(np.pi / 4)
    # The slow one has sigma .2, the mean of the two others .1/sqrt(2): K = .005/(.005 + .04) = 1/9.
    course["course_min_speed_mps"] = 0.9
    assert yaw_at_the_end(**course) == pytest.approx(np.pi / 4 - 3 * np.pi / 4 / 9)
    # With a large minimum sigma all three have the same weight.
    assert yaw_at_the_end(**course, course_sigma_min_rad=1.0) == pytest.approx(np.pi / 4 - 3 * np.pi / 4 / 3)


@pytest.mark.parametrize(
    ("preset", "expected"),
    [("field", Tilt()), ("real", Tilt(sigma_accel_mps2=0.5, propagation="exact")), ("none", Tilt(adapt="none"))],
)
def test_the_presets(preset, expected):
    config = OmegaConf.to_container(OmegaConf.load(PRESETS / f"{preset}.yaml"))
    assert config.pop("defaults") == ["tilt", "_self_"]
    made, start = create("attitude", {"name": "tilt", **config}), TiltStart(np.array([0.0, 0.0, 1.0]), 0.03)
    assert made.state(start).sigma_accel_mps2 == expected.state(start).sigma_accel_mps2
    assert replace(made, sigma_accel_mps2=expected.sigma_accel_mps2) == expected
