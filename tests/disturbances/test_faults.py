"""Faults with a size and a length: slow errors, late fixes, a lever arm, false fixes, and what is only stated."""

import numpy as np
import pytest

from jerkbench.disturbances.imu import WheelSlip
from jerkbench.disturbances.multipath import MultipathAllAxes, MultipathSingleAxis, RtkFloat
from jerkbench.disturbances.noise import Coloured, StatedCovariance
from jerkbench.disturbances.position_errors import FalseFix, LeverArm, Outliers
from jerkbench.disturbances.stamps import Latency
from jerkbench.errors import RecordingError
from jerkbench.recording import Reference


def moved(done, recording):
    return done.position.enu_m - recording.position.enu_m


def test_a_slow_error_has_its_share_and_its_time(make):
    recording = make(duration_s=4000.0)
    done = Coloured(position_share=0.8, position_time_s=10.0).apply(recording, 0)
    unit = moved(done, recording) / 1e-2  # the noise that was there has 1 cm
    assert np.mean(unit**2) == pytest.approx(4.0, rel=0.1)  # .8/(1 - .8)
    assert np.mean(unit[40:] * unit[:-40]) / np.mean(unit**2) == pytest.approx(np.exp(-1.0), abs=0.06)
    np.testing.assert_allclose(done.position.covariance_m2, 5 * recording.position.covariance_m2)
    np.testing.assert_allclose(done.position.true_covariance_m2, 5 * recording.position.covariance_m2)
    assert done.velocity is recording.velocity


def test_a_slow_error_that_is_not_reported_is_in_the_true_covariance_alone(recording):
    done = Coloured(position_share=0.5, velocity_share=0.5, reported=False).apply(recording, 0)
    np.testing.assert_array_equal(done.position.covariance_m2, recording.position.covariance_m2)
    np.testing.assert_allclose(done.velocity.true_covariance_m2ps2, 2 * recording.velocity.covariance_m2ps2)


def test_late_fixes_keep_their_values(recording):
    done = Latency(position_s=0.1, heading_s=0.3).apply(recording, 0)
    m = len(done.position.t_s)
    np.testing.assert_allclose(done.position.t_s, recording.position.t_s[:m] + 0.1)
    np.testing.assert_array_equal(done.position.enu_m, recording.position.enu_m[:m])
    assert done.position.t_s[-1] <= recording.duration_s
    assert done.velocity is recording.velocity
    assert len(done.heading.t_s) == len(recording.heading.t_s) - 2


def test_the_arm_turns_with_the_vehicle(make):
    t_s = make().position.t_s
    euler = np.column_stack([0 * t_s, 0 * t_s, np.where(t_s < 60, 0.0, np.pi / 2)])
    recording = make(reference=Reference(t_s, "truth", independent=True, enu_m=make().position.enu_m, euler_rad=euler))
    done = LeverArm(1.0, 0.2, -0.5).apply(recording, 0)
    np.testing.assert_allclose(moved(done, recording)[t_s < 60], np.tile([1.0, 0.2, -0.5], (240, 1)), atol=1e-12)
    np.testing.assert_allclose(moved(done, recording)[t_s >= 60][0], [-0.2, 1.0, -0.5], atol=1e-12)
    o = np.array([1.0, 0.2, -0.5])
    np.testing.assert_allclose(done.position.true_covariance_m2[0], np.outer(o, o) + 1e-4 * np.eye(3))
    np.testing.assert_array_equal(done.position.covariance_m2, recording.position.covariance_m2)


def test_an_arm_needs_an_attitude(recording):
    with pytest.raises(RecordingError, match="attitude"):
        LeverArm().apply(recording, 0)


def test_only_what_is_stated_changes(recording):
    done = StatedCovariance(position_factor=0.1, velocity_factor=3.0).apply(recording, 0)
    np.testing.assert_array_equal(done.position.enu_m, recording.position.enu_m)
    np.testing.assert_allclose(done.position.covariance_m2, 0.01 * recording.position.covariance_m2)
    np.testing.assert_array_equal(done.position.true_covariance_m2, recording.position.covariance_m2)
    np.testing.assert_allclose(done.velocity.covariance_m2ps2, 9 * recording.velocity.covariance_m2ps2)


def test_a_false_fix_has_the_given_size_and_one_direction_a_window(recording):
    done = FalseFix(offset_m=0.7, count=2, length_s=5.0, first_s=20.0, every_s=30.0).apply(recording, 1)
    offset, t_s = moved(done, recording), recording.position.t_s
    inside = ((t_s >= 20) & (t_s < 25)) | ((t_s >= 50) & (t_s < 55))
    np.testing.assert_allclose(np.linalg.norm(offset, axis=1), np.where(inside, 0.7, 0.0), atol=1e-9)
    assert len(np.unique(np.round(offset, 9), axis=0)) == 3  # none, and two directions
    np.testing.assert_array_equal(done.position.covariance_m2, recording.position.covariance_m2)


def test_another_size_is_the_same_fault_scaled(recording):
    small, large = (moved(FalseFix(offset_m=d).apply(recording, 5), recording) for d in (0.1, 2.0))
    np.testing.assert_allclose(20 * small, large, atol=1e-9)


@pytest.mark.parametrize("fault", [MultipathSingleAxis, MultipathAllAxes])
def test_bursts_of_one_size_and_one_length(recording, fault):
    kwargs = {"bursts": 4, "size_m": 3.0, "length_s": 2.0}
    offset = moved(fault(**kwargs).apply(recording, 0), recording)
    hit = np.abs(offset).max(axis=1) > 1e-9
    np.testing.assert_allclose(np.abs(offset[hit]).max(axis=1), 3.0, atol=1e-9)
    assert hit.sum() in range(4 * 8 - 4, 4 * 8 + 5)  # four of 2 s at 4 Hz


def test_outliers_of_one_size(recording):
    size = np.linalg.norm(moved(Outliers(probability=0.3, size_m=8.0).apply(recording, 0), recording), axis=1)
    assert set(np.round(size, 9)) == {0.0, 8.0}


def test_float_solutions_and_slips_have_regular_windows_and_a_factor(recording):
    windows = {"count": 2, "length_s": 6.0, "first_s": 10.0, "every_s": 50.0}
    offsets = [moved(RtkFloat(factor=f, **windows).apply(recording, 0), recording) for f in (1.0, 2.0)]
    np.testing.assert_allclose(2 * offsets[0], offsets[1], atol=1e-9)
    t_s = recording.position.t_s
    inside = ((t_s >= 10) & (t_s < 16)) | ((t_s >= 60) & (t_s < 66))
    np.testing.assert_array_equal(np.abs(offsets[0]).max(axis=1) > 1e-9, inside)
    slipped = WheelSlip(slip=0.5, **windows).apply(recording, 0)
    np.testing.assert_array_equal((slipped.velocity.mps != recording.velocity.mps).any(axis=1), inside)
