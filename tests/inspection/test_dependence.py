"""A velocity that is the slope of its positions, and one that is not."""

import dataclasses

import numpy as np
import pytest

from jerkbench.datasets.field import FieldWhite
from jerkbench.inspection.noise import velocity_dependence
from jerkbench.plugins.samples import small_recording
from jerkbench.recording import Position, Velocity


def with_velocity(recording, mps):
    position = recording.position
    covariance = np.tile(0.01 * np.eye(3), (len(mps), 1, 1))
    return dataclasses.replace(recording, velocity=Velocity(position.t_s, mps, covariance))


@pytest.mark.parametrize("late", [0, 1])
def test_the_backward_difference_of_the_positions_is_found(late):
    drive = FieldWhite(duration_s=60.0).load(0)
    p, t = drive.position.enu_m, drive.position.t_s
    slope = np.vstack([np.zeros((1 + late, 3)), (np.diff(p, axis=0) / np.diff(t)[:, None])[: len(p) - 1 - late]])
    found = dict(velocity_dependence(with_velocity(drive, slope)))
    assert list(found) == ["velocity, horizontal", "velocity, up"]
    assert min(found.values()) > 0.999
    half = slope + np.std(np.diff(slope, axis=0)) * np.random.default_rng(0).normal(size=slope.shape)
    assert all(0.3 < correlation < 0.9 for _, correlation in velocity_dependence(with_velocity(drive, half)))


def test_noise_of_its_own_is_found_too():
    for _, correlation in velocity_dependence(FieldWhite(duration_s=120.0).load(0)):
        assert abs(correlation) < 0.2


def test_a_velocity_without_a_position_for_each_is_left_out():
    small = small_recording()
    assert list(velocity_dependence(small)) == []  # a fix lacks its height
    position = small.position
    fewer = Position(position.t_s[:50], np.nan_to_num(position.enu_m[:50]), position.covariance_m2[:50])
    assert list(velocity_dependence(dataclasses.replace(small, position=fewer))) == []
    assert list(velocity_dependence(dataclasses.replace(small, velocity=None))) == []
