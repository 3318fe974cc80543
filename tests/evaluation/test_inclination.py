"""The angle between the verticals against arccosines of rotation matrices, and the floor against tilts put in."""

import dataclasses

import numpy as np
import pytest

from jerkbench.evaluation.counted_rows import counted_rows
from jerkbench.evaluation.metrics.attitude import AttitudeRmse, Inclination
from jerkbench.geometry import dcm_from_euler
from jerkbench.recording import Imu, Position, Recording, Reference, Velocity


@pytest.fixture
def counted(estimate, recording):
    return counted_rows(estimate, recording, 5.0)


def test_the_angle_is_that_between_the_third_rows_of_the_matrices(estimate, recording, counted):
    truth = recording.reference.euler_rad[estimate.index]
    cosines = np.einsum("ki,ki->k", dcm_from_euler(estimate.euler_rad)[:, 2], dcm_from_euler(truth)[:, 2])
    angles = np.arccos(cosines)[counted]
    values = Inclination().evaluate(estimate, recording, counted)

    assert values["inclination_rmse_rad"] == pytest.approx(np.sqrt(np.mean(angles**2)), rel=1e-9)
    assert values["inclination_rmse_deg"] == pytest.approx(np.degrees(values["inclination_rmse_rad"]))
    assert values["inclination_max_deg"] == pytest.approx(np.degrees(angles.max()))


def test_yaw_does_not_matter(estimate, recording, counted):
    turned = dataclasses.replace(estimate, euler_rad=estimate.euler_rad + np.array([0.0, 0.0, 1.0]))
    assert Inclination().evaluate(turned, recording, counted) == pytest.approx(
        Inclination().evaluate(estimate, recording, counted), nan_ok=True
    )


def test_without_an_attitude_reference_there_is_no_value(estimate, recording, counted):
    blind = dataclasses.replace(recording, reference=dataclasses.replace(recording.reference, euler_rad=None))
    assert all(np.isnan(value) for value in Inclination().evaluate(estimate, blind, counted).values())


def still_recording(tilt_rad, turning_radps=0.0):
    """Ten seconds at rest whose reference is rolled by ``tilt_rad`` against the accelerometer; scored nowhere."""
    t_s = np.arange(1000) / 100
    euler = np.zeros((1000, 3))
    euler[:, 0] = tilt_rad
    euler[:100] = np.nan
    gyro = np.zeros((1000, 3))
    gyro[::2, 1] = turning_radps
    reference = Reference(t_s, "made", independent=True, euler_rad=euler, scored=np.zeros(1000, dtype=bool))
    return Recording("still", Imu(t_s, np.tile([0.0, 0.0, 9.9], (1000, 1)), gyro), reference)


def floor_deg(estimate, recording):
    nothing = np.zeros(0, dtype=bool)
    none = dataclasses.replace(estimate, index=np.zeros(0, dtype=np.int64), euler_rad=np.zeros((0, 3)))
    return Inclination().evaluate(none, recording, nothing)["inclination_floor_deg"]


def test_the_floor_is_what_accelerometer_and_reference_disagree_by_at_rest(estimate):
    assert floor_deg(estimate, still_recording(0.01)) == pytest.approx(np.degrees(0.01), rel=1e-9)
    assert np.isnan(floor_deg(estimate, still_recording(0.01, turning_radps=0.1)))


def test_roll_and_yaw_do_not_count_where_the_reference_stands_on_its_nose(estimate, recording, counted):
    euler = recording.reference.euler_rad.copy()
    euler[30:, 1] = 1.5
    steep = dataclasses.replace(recording, reference=dataclasses.replace(recording.reference, euler_rad=euler))
    values = AttitudeRmse().evaluate(estimate, steep, counted)
    level = counted & (np.abs(euler[estimate.index, 1]) < np.radians(75))
    error = (estimate.euler_rad - euler[estimate.index])[:, 0]
    error = (error + np.pi) % (2 * np.pi) - np.pi

    assert 0 < level.sum() < counted.sum()
    assert values["roll_rmse_rad"] == pytest.approx(np.sqrt(np.mean(error[level] ** 2)))


@pytest.mark.parametrize("known", ["reference", "velocity", "places"])
def test_straight_driving_is_no_rest(estimate, known):
    standing = still_recording(0.01)
    t_s = np.arange(100) / 10
    along = np.column_stack([np.maximum(t_s - 5.0, 0.0) * 8.0, 0 * t_s, 0 * t_s])
    speed = np.column_stack([8.0 * (t_s > 5.0), 0 * t_s, 0 * t_s])
    tilted = standing.reference.euler_rad.copy()
    tilted[500:, 0] = 0.5
    reference = dataclasses.replace(standing.reference, euler_rad=tilted)
    moving = dataclasses.replace(standing, reference=reference)
    cov = np.tile(np.eye(3), (100, 1, 1))
    if known == "velocity":
        moving = dataclasses.replace(moving, velocity=Velocity(t_s, speed, cov))
    elif known == "places":
        moving = dataclasses.replace(moving, position=Position(t_s, along, cov))
    else:
        rate = np.interp(reference.t_s, t_s, speed[:, 0])[:, None] * [1.0, 0.0, 0.0]
        moving = dataclasses.replace(moving, reference=dataclasses.replace(reference, velocity_mps=rate))
    assert floor_deg(estimate, moving) == pytest.approx(np.degrees(0.01), rel=1e-9)
