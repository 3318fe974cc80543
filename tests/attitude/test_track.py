"""Yaw from the track of the fixes, against closed forms and least squares."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from jerkbench.adaptation.none import NoAdaptation
from jerkbench.attitude import yaw as track
from jerkbench.attitude.tilt import Tilt
from jerkbench.attitude.yaw import (
    UNKNOWN_RAD,
    Chords,
    Courses,
    courses_of,
    estimate_yaw,
    filter_drift,
    offsets_at,
    rate_at_rest,
    required_track,
    select_headings,
)
from jerkbench.datasets.path import DrivenPath
from jerkbench.errors import RecordingError
from jerkbench.filters.eskf15 import Eskf15
from jerkbench.filters.inertial_parameters import first_yaw
from jerkbench.geometry import wrap_angle
from jerkbench.recording import Imu, Velocity
from synthetic import recording_at_rest

WALK = 2e-4


def circle_chord(begin_s, end_s, yaw_rad, rate_radps, speed_mps, slope_mps2=0.0):
    """A chord of a circle with the yaw ``yaw_rad`` at time 0 and the speed ``speed_mps`` in the middle."""
    middle_s = 0.5 * (begin_s + end_s)

    def along(t, part):
        return (speed_mps + slope_mps2 * (t - middle_s)) * part(yaw_rad + rate_radps * t)

    return [quad(along, begin_s, end_s, args=(part,))[0] for part in (np.cos, np.sin)]


@pytest.mark.parametrize("rate_radps", [0.0, 0.1, -0.9])
def test_the_offset_of_a_chord_is_correct_for_any_turn(rate_radps):
    nodes_s = np.arange(0.0, 10.001, 0.01)
    way = circle_chord(2.345, 5.0, 2.5, rate_radps, 8.0)
    chords = Chords(np.array([2.345]), np.array([5.0]), np.array([way]), np.array([0.03]))
    courses = courses_of(chords, nodes_s, rate_radps * nodes_s, 0.0087)

    assert courses.offset_rad[0] == pytest.approx(2.5, abs=1e-4)
    assert 0.03 <= courses.sigma_rad[0] <= 0.03 + 0.06 * abs(rate_radps)
    assert (courses.t_s[0], courses.lag_s[0]) == (5.0, pytest.approx(0.5 * (5.0 - 2.345)))


def test_the_sigma_includes_an_acceleration_in_a_turn():
    nodes_s = np.arange(0.0, 10.001, 0.01)
    way = circle_chord(2.0, 4.0, 0.3, 0.5, 8.0, slope_mps2=1.0)
    chords = Chords(np.array([2.0]), np.array([4.0]), np.array([way]), np.array([1e-6]))
    courses = courses_of(chords, nodes_s, 0.5 * nodes_s, 1e-6)

    assert courses.sigma_rad[0] == pytest.approx(courses.offset_rad[0] - 0.3, rel=0.02)  # the acceleration is one sigma
    assert courses.sigma_rad[0] == pytest.approx(0.5 * 2.0**2 / (12 * 8.0), rel=0.05)  # a w T^2/(12 v)


def test_the_filter_is_least_squares_of_offset_and_bias(monkeypatch):
    monkeypatch.setattr(track, "YAW_BIAS_WALK", 0.0)
    rng = np.random.default_rng(0)
    t_s, lag_s, sigma = np.cumsum(rng.uniform(0.5, 3.0, 40)), rng.uniform(0.2, 2.0, 40), rng.uniform(0.02, 0.1, 40)
    z = 3.0 - 0.004 * (t_s - lag_s) + sigma * rng.normal(size=40)  # does not exceed pi, because the slope is negative
    drift = filter_drift(Courses(t_s, lag_s, wrap_angle(z), sigma), (0.001, 0.01), 0.0)
    rows = np.column_stack([np.ones(40), t_s - lag_s - t_s[-1]]) / sigma[:, None]  # of the state at the last course
    A, b = np.vstack([rows, [0.0, 100.0]]), np.concatenate([z / sigma, [0.1]])  # and 0.001 +- 0.01 as one more row
    P = np.linalg.inv(A.T @ A)

    np.testing.assert_allclose(drift.x[-1], P @ A.T @ b, rtol=1e-9)
    np.testing.assert_allclose(drift.P[-1], P, rtol=1e-7)
    offset, sigma_after = offsets_at(drift, np.array([t_s[-1] + 5.0]), 0.0)
    assert offset[0] == pytest.approx([1.0, 5.0] @ (P @ A.T @ b))
    assert sigma_after[0] == pytest.approx(np.sqrt([1.0, 5.0] @ P @ [1.0, 5.0]))


def constant(z, every_s=2.0):
    n = len(z)
    return Courses(every_s * np.arange(1.0, n + 1), np.zeros(n), wrap_angle(np.array(z)), np.full(n, 0.05))


def test_one_outlier_is_dropped_and_two_consistent_outliers_restart_the_filter():
    single = filter_drift(constant([0.1, 0.1, 2.0, 0.1, 0.1]), (0.0, 1e-6), WALK)
    np.testing.assert_allclose(single.x[:, 0], 0.1, atol=1e-9)
    assert len(single.t_s) == 4

    reversed_first = filter_drift(constant([np.pi, 0.1, 0.1, 0.1]), (0.0, 1e-6), WALK)
    np.testing.assert_allclose(reversed_first.x[-1, 0], 0.1, atol=1e-9)
    assert reversed_first.P[1, 0, 0] == pytest.approx(0.05**2)  # earlier courses are ignored

    scattered = filter_drift(constant([0.1, 2.0, -2.0, 0.1]), (0.0, 1e-6), WALK)
    np.testing.assert_allclose(scattered.x[:, 0], 0.1, atol=1e-9)


def test_a_rest_determines_the_bias():
    t_s = np.arange(1, 501) / 100
    rate = np.where(t_s <= 2.0, 0.03, 0.5)

    assert rate_at_rest(t_s, rate, 2.0, WALK) == (pytest.approx(-0.03), pytest.approx(WALK / np.sqrt(2.0), rel=0.01))
    assert rate_at_rest(t_s, rate, 0.0, WALK) == (0.0, track.TURN_ON_RADPS)


def curved_drive(rate=0.1, speed=2.0, bias=0.05, rest_s=2.0):
    """A rest, then a circle that starts with the yaw 0.5; the gyro has a bias."""
    recording = recording_at_rest(duration_s=30.0, gnss_rate_hz=4, velocity=None, static_start_s=rest_s)
    t, fixes = recording.imu.t_s, recording.position
    gyro = np.zeros((len(t), 3))
    gyro[:, 2] = np.where(t > rest_s, rate, 0.0) + bias
    driven = np.maximum(fixes.t_s - rest_s, 0.0)
    yaw = 0.5 + rate * driven
    enu = np.zeros((len(driven), 3))
    enu[:, 0] = speed / rate * (np.sin(yaw) - np.sin(0.5))
    enu[:, 1] = -speed / rate * (np.cos(yaw) - np.cos(0.5))
    return replace(recording, imu=Imu(t, recording.imu.accel_mps2, gyro), position=replace(fixes, enu_m=enu))


def test_before_a_course_the_gyro_without_its_bias_is_subtracted_and_later_fixes_have_no_effect():
    recording = curved_drive()
    imu = recording.imu
    yaw = estimate_yaw(imu, *np.zeros((2, len(imu.t_s))), required_track(recording), WALK)
    true = 0.5 + 0.1 * np.maximum(imu.t_s - 2.0, 0.0)
    np.testing.assert_allclose(wrap_angle(yaw.rad - true), 0.0, atol=2e-3)
    assert yaw.sigma_rad[-1] < yaw.sigma_rad[0] < 0.05
    enu_m = recording.position.enu_m.copy()
    enu_m[-20:] += [0.3, -0.3, 0.0]
    moved = replace(recording, position=replace(recording.position, enu_m=enu_m))
    before, after = (Tilt().estimate(r).euler_rad[:, 2] for r in (recording, moved))
    same = recording.imu.t_s < recording.position.t_s[-20]
    np.testing.assert_array_equal(before[same], after[same])
    assert (before != after)[~same].any()


def test_auto_uses_the_track_without_headings_and_velocities_over_ground():
    recording = curved_drive()
    slow = Velocity([5.0], [[0.1, 0.1, 0.0]], [np.eye(3)])
    for velocity in (None, slow, Velocity.along_course([5.0], [2.0], 0.1)):
        selected = select_headings(replace(recording, velocity=velocity), "auto", 0.5, 0.0087)
        assert isinstance(selected, track.Track)
    rest = recording_at_rest(velocity=None)
    assert select_headings(rest, "auto", 0.5, 0.0087) is None
    assert Tilt().estimate(rest).yaw_sigma_rad[0] == UNKNOWN_RAD
    with pytest.raises(RecordingError, match="no course can be computed from the fixes"):
        select_headings(rest, "track", 0.5, 0.0087)


@pytest.fixture(scope="module")
def car():
    """A car with position fixes at 1 Hz with a sigma of 0.4 m, and no other measurements."""
    way = ((0.0, 0.0), (150.0, 0.0), (180.0, 30.0), (180.0, 200.0), (150.0, 230.0), (0.0, 230.0))
    path = DrivenPath(waypoints_m=way, ramp_s=6.0, speed_mps=10.0, gnss_rate_hz=1.0, position_sigma_m=(0.4, 0.4, 0.8))
    return [replace(path.load(seed), velocity=None, heading=None) for seed in range(3)]


def test_the_yaw_of_a_car_with_only_fixes_is_consistent(car):
    for recording in car:
        attitude = Tilt(adapt="mtf", sigma_accel_mps2=0.5, propagation="exact").estimate(recording)
        off = wrap_angle(attitude.euler_rad[:, 2] - recording.reference.euler_rad[:, 2])

        assert np.abs(off).max() < 0.12
        assert (np.abs(off) / attitude.yaw_sigma_rad).max() < 4.0
        assert np.sqrt(np.mean(off[2000:] ** 2)) < 0.03


def test_eskf15_starts_with_the_sigma_of_the_track(car):
    (recording, *_), model = car, Eskf15()
    attitude = Tilt().estimate(recording)
    noisy = replace(recording.position, covariance_m2=100.0 * recording.position.covariance_m2)
    coarse = Tilt().estimate(replace(recording, position=noisy))

    assert coarse.yaw_sigma_rad[0] > 0.05
    for source in ("attitude", "track"):
        modified = replace(model, yaw_source=source)
        assert first_yaw(modified, recording, attitude, 0)[0] == pytest.approx(attitude.euler_rad[0, 2], abs=1e-9)
    assert first_yaw(model, recording, coarse, 0)[1] == coarse.yaw_sigma_rad[0]
    assert model.estimate(recording, attitude, NoAdaptation()).failure == ""
