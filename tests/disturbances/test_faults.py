"""Faults of the fixes: size, length, time correlation, and what their covariances state."""

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from jerkbench.disturbances.imu import WheelSlip
from jerkbench.disturbances.multipath import MultipathAllAxes, MultipathSingleAxis, RtkFloat, RtkFloatOverconfident
from jerkbench.disturbances.noise import Coloured, StatedCovariance
from jerkbench.disturbances.position_errors import FalseFix, LeverArm, Outliers
from jerkbench.disturbances.stamps import Latency
from jerkbench.errors import RecordingError
from jerkbench.recording import Reference
from jerkbench.simulation.sensors import gauss_markov


def moved(done, recording):
    return done.position.enu_m - recording.position.enu_m


def test_a_slow_error_has_its_variance_and_correlation_time(make):
    recording = make(duration_s=4000.0)
    done = Coloured(position_share=0.8, position_time_s=10.0).apply(recording, 0)
    unit = moved(done, recording) / 1e-2  # the original noise has a sigma of 1 cm
    assert np.mean(unit**2) == pytest.approx(4.0, rel=0.1)  # .8/(1 - .8)
    assert np.mean(unit[40:] * unit[:-40]) / np.mean(unit**2) == pytest.approx(np.exp(-1.0), abs=0.06)
    np.testing.assert_allclose(done.position.covariance_m2, 5 * recording.position.covariance_m2)
    np.testing.assert_allclose(done.position.true_covariance_m2, 5 * recording.position.covariance_m2)
    assert done.velocity is recording.velocity
    unreported = Coloured(position_share=0.5, velocity_share=0.5, reported=False).apply(recording, 0)
    np.testing.assert_array_equal(unreported.position.covariance_m2, recording.position.covariance_m2)
    np.testing.assert_allclose(unreported.velocity.true_covariance_m2ps2, 2 * recording.velocity.covariance_m2ps2)


def test_latency_does_not_change_values(recording):
    done = Latency(position_s=0.1, heading_s=0.3).apply(recording, 0)
    m = len(done.position.t_s)
    np.testing.assert_allclose(done.position.t_s, recording.position.t_s[:m] + 0.1)
    np.testing.assert_array_equal(done.position.enu_m, recording.position.enu_m[:m])
    assert done.position.t_s[-1] <= recording.duration_s
    assert done.velocity is recording.velocity
    assert len(done.heading.t_s) == len(recording.heading.t_s) - 2


def test_the_arm_rotates_with_the_vehicle(make):
    t_s = make().position.t_s
    euler = np.column_stack([0 * t_s, 0 * t_s, np.where(t_s < 60, 0.0, np.pi / 2)])
    recording = make(reference=Reference(t_s, "truth", independent=True, enu_m=make().position.enu_m, euler_rad=euler))
    done = LeverArm(1.0, 0.2, -0.5).apply(recording, 0)
    np.testing.assert_allclose(moved(done, recording)[t_s < 60], np.tile([1.0, 0.2, -0.5], (240, 1)), atol=1e-12)
    np.testing.assert_allclose(moved(done, recording)[t_s >= 60][0], [-0.2, 1.0, -0.5], atol=1e-12)
    o = np.array([1.0, 0.2, -0.5])
    np.testing.assert_allclose(done.position.true_covariance_m2[0], np.outer(o, o) + 1e-4 * np.eye(3))
    np.testing.assert_array_equal(done.position.covariance_m2, recording.position.covariance_m2)
    with pytest.raises(RecordingError, match="attitude"):
        LeverArm().apply(make(), 0)


def test_only_the_reported_covariance_changes(recording):
    done = StatedCovariance(position_factor=0.1, velocity_factor=3.0).apply(recording, 0)
    np.testing.assert_array_equal(done.position.enu_m, recording.position.enu_m)
    np.testing.assert_allclose(done.position.covariance_m2, 0.01 * recording.position.covariance_m2)
    np.testing.assert_array_equal(done.position.true_covariance_m2, recording.position.covariance_m2)
    np.testing.assert_allclose(done.velocity.covariance_m2ps2, 9 * recording.velocity.covariance_m2ps2)


def test_a_false_fix_has_the_given_size_and_one_direction_per_window(recording):
    done = FalseFix(offset_m=0.7, count=2, length_s=5.0, first_s=20.0, every_s=30.0).apply(recording, 1)
    offset, t_s = moved(done, recording), recording.position.t_s
    inside = ((t_s >= 20) & (t_s < 25)) | ((t_s >= 50) & (t_s < 55))
    np.testing.assert_allclose(np.linalg.norm(offset, axis=1), np.where(inside, 0.7, 0.0), atol=1e-9)
    assert len(np.unique(np.round(offset, 9), axis=0)) == 3  # zero, and two directions
    np.testing.assert_array_equal(done.position.covariance_m2, recording.position.covariance_m2)
    small, large = (moved(FalseFix(offset_m=d).apply(recording, 5), recording) for d in (0.1, 2.0))
    np.testing.assert_allclose(20 * small, large, atol=1e-9)
    size = np.linalg.norm(moved(Outliers(probability=0.3, size_m=8.0).apply(recording, 0), recording), axis=1)
    assert set(np.round(size, 9)) == {0.0, 8.0}


@pytest.mark.parametrize("fault", [MultipathSingleAxis, MultipathAllAxes])
def test_bursts_of_one_size_and_one_length(recording, fault):
    kwargs = {"bursts": 4, "size_m": 3.0, "length_s": 2.0}
    offset = moved(fault(**kwargs).apply(recording, 0), recording)
    hit = np.abs(offset).max(axis=1) > 1e-9
    np.testing.assert_allclose(np.abs(offset[hit]).max(axis=1), 3.0, atol=1e-9)
    assert hit.sum() in range(4 * 8 - 4, 4 * 8 + 5)  # four of 2 s at 4 Hz


def test_float_solutions_and_slips_have_regular_windows_and_a_factor(recording):
    windows = {"count": 2, "length_s": 6.0, "first_s": 10.0, "every_s": 50.0}
    offsets = [moved(RtkFloat(factor=f, **windows).apply(recording, 0), recording) for f in (1.0, 2.0)]
    np.testing.assert_allclose(2 * offsets[0], offsets[1], atol=1e-9)
    t_s = recording.position.t_s
    inside = ((t_s >= 10) & (t_s < 16)) | ((t_s >= 60) & (t_s < 66))
    np.testing.assert_array_equal(np.abs(offsets[0]).max(axis=1) > 1e-9, inside)
    slipped = WheelSlip(slip=0.5, **windows).apply(recording, 0)
    np.testing.assert_array_equal((slipped.velocity.mps != recording.velocity.mps).any(axis=1), inside)


def bursts_with(recording, seed):
    """Intervals of equal, nonzero shift: (first time, last time, shift)."""
    shift = np.round(MultipathSingleAxis().apply(recording, seed).position.enu_m - recording.position.enu_m, 9)
    t_s, edges = recording.position.t_s, np.flatnonzero(np.r_[True, (np.diff(shift, axis=0) != 0).any(axis=1), True])
    runs = [(t_s[begin], t_s[end - 1], shift[begin]) for begin, end in itertools.pairwise(edges)]
    return [run for run in runs if run[2].any()]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])  # the recording is the same for every seed
@given(st.integers(0, 2**31 - 1))
def test_bursts_have_the_given_number_length_and_size(make, seed):
    bursts = bursts_with(make(duration_s=150.0, rate_hz=10), seed)
    assert len(bursts) == 10
    for begin, end, offset in bursts:
        assert begin >= 10
        assert 1.8 <= end - begin <= 6.0  # the interval between fixes is 0.1 s
        assert np.count_nonzero(offset) == 1
        assert 0.5 <= np.abs(offset).max() <= 2.0


def test_every_axis_is_hit_in_both_directions(make):
    recording = make(duration_s=150.0, rate_hz=10)
    offsets = np.array([offset for seed in range(20) for *_, offset in bursts_with(recording, seed)])
    assert (np.sign(offsets).min(axis=0) == -1).all()
    assert (np.sign(offsets).max(axis=0) == 1).all()


def test_only_the_true_covariance_changes_and_absent_axes_stay_absent(recording, make):
    done = MultipathSingleAxis().apply(recording, 1).position
    np.testing.assert_array_equal(done.covariance_m2, recording.position.covariance_m2)
    shift = done.enu_m - recording.position.enu_m
    for reported, true, moved in zip(done.covariance_m2, done.true_covariance_m2, shift, strict=True):
        np.testing.assert_allclose(true, reported + np.diag(moved**2), atol=1e-9)
    enu_m = recording.position.enu_m.copy()
    enu_m[:, 2] = np.nan
    position = dataclasses.replace(recording.position, enu_m=enu_m)
    done = MultipathSingleAxis().apply(make(position=position), 1).position
    assert np.isnan(done.enu_m[:, 2]).all()
    assert np.isfinite(done.enu_m[:, :2]).all()


def test_a_short_recording_raises(make):
    with pytest.raises(RecordingError, match=r"do not fit after 10\.0 s"):
        MultipathSingleAxis().apply(make(duration_s=25.0), 0)


def test_only_fixes_in_the_windows_are_float(recording):
    before, done = recording.position, RtkFloat().apply(recording, 1).position
    t_s = before.t_s
    inside = ((t_s >= 30) & (t_s < 60)) | ((t_s >= 95) & (t_s < 120))
    assert (done.enu_m[inside] != before.enu_m[inside]).all()
    np.testing.assert_array_equal(done.enu_m[~inside], before.enu_m[~inside])
    np.testing.assert_allclose(
        done.covariance_m2[inside], before.covariance_m2[inside] + np.diag([0.0625, 0.0625, 0.25])
    )
    np.testing.assert_array_equal(done.covariance_m2[~inside], before.covariance_m2[~inside])
    np.testing.assert_array_equal(done.true_covariance_m2, done.covariance_m2)


def test_an_overconfident_covariance_or_a_moved_window_does_not_change_the_errors(recording):
    honest, boasts = (plugin().apply(recording, 2).position for plugin in (RtkFloat, RtkFloatOverconfident))
    np.testing.assert_array_equal(honest.enu_m, boasts.enu_m)
    np.testing.assert_array_equal(honest.true_covariance_m2, boasts.true_covariance_m2)
    np.testing.assert_array_equal(boasts.covariance_m2, recording.position.covariance_m2)
    one = RtkFloat(windows_s=((30.0, 60.0),)).apply(recording, 0).position.enu_m
    other = RtkFloat(windows_s=((50.0, 90.0),)).apply(recording, 0).position.enu_m
    both = (recording.position.t_s >= 50) & (recording.position.t_s < 60)
    np.testing.assert_array_equal(one[both], other[both])


def test_sigma_and_correlation_time_are_as_given(make):
    """Comparison over 300 seeds with exp(-tau/15 s)."""
    recording = make(duration_s=40.0, rate_hz=1)
    plugin = RtkFloat(windows_s=((0.0, 99.0),))
    b = np.array([plugin.apply(recording, seed).position.enu_m for seed in range(300)]) - recording.position.enu_m
    for t in (0, 20, 40):
        np.testing.assert_allclose(b[:, t].std(axis=0), [0.25, 0.25, 0.5], rtol=0.17)  # 4 standard errors
    for lag in (1, 15, 30):
        now, later = b[:, : 41 - lag], b[:, lag:]
        correlation = (now * later).mean(axis=(0, 1)) / (b**2).mean(axis=(0, 1))
        np.testing.assert_allclose(correlation, np.exp(-lag / 15), atol=0.12)
    assert abs(np.corrcoef(b[:, 20].T) - np.eye(3)).max() < 0.23


def test_the_process_is_exact_at_irregular_times():
    """The linear map from the noise to b gives the covariance of the process."""
    t_s = np.array([0.0, 0.5, 4.0, 4.1, 30.0])

    class Unit:
        def __init__(self, column):
            self.column = column

        def standard_normal(self, shape):
            e = np.zeros(shape)
            e[self.column] = 1.0
            return e

    A = np.column_stack([gauss_markov(t_s, 15.0, Unit(k))[:, 0] for k in range(5)])
    np.testing.assert_allclose(A @ A.T, np.exp(-np.abs(t_s[:, None] - t_s) / 15.0), atol=1e-12)
