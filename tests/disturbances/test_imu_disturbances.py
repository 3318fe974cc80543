"""Disturbances of the IMU and of the wheel."""

import dataclasses

import numpy as np
import pytest

from jerkbench.disturbances.imu import Dropout, ImuBias, ImuVibration, WheelSlip
from jerkbench.disturbances.stamps import Jitter
from jerkbench.errors import RecordingError
from jerkbench.recording import Imu, Recording, Reference, Velocity


def at_rest(n=20000, rate_hz=100.0):
    t_s = np.arange(1, n + 1) / rate_hz
    imu = Imu(t_s, np.tile([0, 0, 9.81], (n, 1)), np.zeros((n, 3)))
    return Recording("rest", imu, Reference([1.0], "made up", independent=True))


def vibration(recording, seed=0, **parameters):
    done = ImuVibration(**parameters).apply(recording, seed).imu
    return np.hstack([done.accel_mps2 - recording.imu.accel_mps2, done.gyro_radps - recording.imu.gyro_radps])


def test_vibration_has_its_sigma_and_its_band_and_is_a_function_of_time():
    recording = at_rest()
    noise = vibration(recording, accel_mps2=2.0, gyro_radps=0.05, lowest_hz=10.0, highest_hz=20.0)
    np.testing.assert_allclose(noise.std(axis=0) / [2, 2, 2, 0.05, 0.05, 0.05], 1, atol=0.4)
    hz = np.fft.rfftfreq(len(noise), 0.01)
    power = np.abs(np.fft.rfft(noise * np.hanning(len(noise))[:, None], axis=0)) ** 2
    assert power[(hz < 9.9) | (hz > 20.1)].sum() < 1e-4 * power.sum()
    for low in (10.0, 12.5, 15.0, 17.5):  # quarters of the band, over all axes
        part = power[(hz >= low) & (hz < low + 2.5)].sum(axis=0) / power.sum(axis=0)
        assert part.mean() == pytest.approx(0.25, abs=0.1)
    recording = at_rest(3, 7.0)
    drawn = np.array([vibration(recording, seed, accel_mps2=1.0, gyro_radps=1.0)[1] for seed in range(600)])
    np.testing.assert_allclose(drawn.std(axis=0), 1, atol=0.12)  # four standard errors
    assert abs(np.corrcoef(drawn.T) - np.eye(6)).max() < 0.17
    assert abs((drawn**4).mean(axis=0) / 3 - 1).max() < 0.5  # kurtosis of a Gaussian distribution
    recording = at_rest(1000)
    rows = np.arange(1000) % 3 == 0
    holed = Recording("rest", Imu(*(a[rows] for a in vars(recording.imu).values())), recording.reference)
    np.testing.assert_allclose(vibration(holed), vibration(recording)[rows], atol=1e-12)


def test_dropped_samples_have_the_given_number_and_length():
    recording = at_rest()
    t_s = Dropout(probability=0.02, longest=4).apply(recording, 1).imu.t_s
    gaps = np.round(np.diff(t_s) / 0.01).astype(int) - 1
    assert gaps.max() >= 4
    assert 0.01 < (1 - len(t_s) / 20000) < 0.06  # 0.049, or 0.02 times 2.5 without overlaps
    counts = np.bincount(gaps)[1:5]
    np.testing.assert_allclose(counts / counts.sum(), 0.25, atol=0.08)
    assert t_s[[0, -1]].tolist() == recording.imu.t_s[[0, -1]].tolist()
    done = Dropout(probability=0.3, longest=1).apply(recording, 1).imu
    assert 1 - len(done.t_s) / 20000 == pytest.approx(0.3, abs=0.015)
    assert np.isin(done.t_s, recording.imu.t_s).all()
    assert len(Dropout(probability=1.0).apply(recording, 0).imu.t_s) == 2
    assert len(Dropout(probability=0.0).apply(recording, 0).imu.t_s) == 20000


def test_remaining_samples_do_not_change(recording):
    accel = np.arange(len(recording.imu.t_s))[:, None] * [1.0, 2.0, 3.0]
    numbered = Recording("n", Imu(recording.imu.t_s, accel, -accel), recording.reference)
    done = Dropout(probability=0.2).apply(numbered, 0).imu
    np.testing.assert_allclose(done.accel_mps2[:, 0], done.t_s * 20, atol=1e-9)
    np.testing.assert_array_equal(done.gyro_radps, -done.accel_mps2)


def test_jitter_has_its_sigma_and_does_not_change_values(recording):
    done = Jitter(imu_s=0.001, measurement_s=0.01).apply(recording, 0)
    for name, sigma in (("imu", 0.001), ("position", 0.01), ("velocity", 0.01), ("heading", 0.01)):
        error = getattr(done, name).t_s - getattr(recording, name).t_s
        assert error.std() == pytest.approx(sigma, rel=0.15)
        assert abs(error.mean()) < 4 * sigma / np.sqrt(len(error))
    np.testing.assert_array_equal(done.position.enu_m, recording.position.enu_m)
    np.testing.assert_array_equal(done.imu.accel_mps2, recording.imu.accel_mps2)
    assert done.imu.t_s[[0, -1]].tolist() == recording.imu.t_s[[0, -1]].tolist()
    errors = [getattr(done, n).t_s - getattr(recording, n).t_s for n in ("position", "velocity", "heading")]
    assert abs(np.corrcoef(errors) - np.eye(3)).max() < 0.2


@pytest.mark.parametrize("seed", range(5))
def test_stamps_are_increasing_with_any_jitter(seed):
    steps = np.random.default_rng(seed).choice([0.001, 0.01, 1.0], 500)
    imu = Imu(np.cumsum(steps), np.ones((500, 3)), np.ones((500, 3)))
    done = Jitter(imu_s=0.5).apply(Recording("u", imu, Reference([1.0], "r", independent=True)), seed)
    left = np.diff(done.imu.t_s) / np.diff(imu.t_s)
    assert left.min() > 0.0999


def biases(recording, plugin, seed):
    imu = plugin.apply(recording, seed).imu
    added = np.hstack([imu.accel_mps2 - recording.imu.accel_mps2, imu.gyro_radps - recording.imu.gyro_radps])
    np.testing.assert_allclose(added, np.tile(added[0], (len(added), 1)), atol=1e-12)
    return added[0]


def test_a_bias_is_constant_over_the_run_and_of_the_right_size_over_seeds(make):
    recording = make(duration_s=1.0)
    drawn = np.array([biases(recording, ImuBias(), seed) for seed in range(400)])
    sigma = drawn.std(axis=0) / [0.08, 0.08, 0.08, 0.002, 0.002, 0.002]
    np.testing.assert_allclose(sigma, 1, atol=0.15)  # four standard errors of a standard deviation of 400
    assert np.abs(np.corrcoef(drawn.T) - np.eye(6)).max() < 0.2
    no_accel = biases(recording, ImuBias(accel_mps2=0.0), 5)
    np.testing.assert_allclose(no_accel, [0, 0, 0, *drawn[5, 3:]], atol=1e-12)


def with_velocity(recording, mps, **parts):
    m = len(recording.position.t_s)
    velocity = Velocity(recording.position.t_s, np.tile(mps, (m, 1)), np.tile(np.eye(3) * 1e-3, (m, 1, 1)), **parts)
    return dataclasses.replace(recording, velocity=velocity)


def heading(recording, yaw_rad):
    reference = recording.reference
    euler = np.column_stack([np.full((len(reference.t_s), 2), 0.2), np.full(len(reference.t_s), yaw_rad)])
    return dataclasses.replace(recording, reference=dataclasses.replace(reference, euler_rad=euler))


def slipped(recording, **parameters):
    """Return the offset in the window, and check that nothing changes outside."""
    done = WheelSlip(windows_s=((20.0, 24.0),), **parameters).apply(recording, 0).velocity
    t_s = done.t_s
    inside = (t_s >= 20) & (t_s < 24)
    offset = done.mps - recording.velocity.mps
    np.testing.assert_array_equal(np.nan_to_num(offset[~inside]), 0)
    np.testing.assert_array_equal(done.covariance_m2ps2, recording.velocity.covariance_m2ps2)
    growth = done.true_covariance_m2ps2 - done.covariance_m2ps2
    known = np.nan_to_num(offset)
    np.testing.assert_allclose(growth, [np.outer(o, o) for o in known], atol=1e-12)
    return offset[inside]


def test_the_slip_is_along_the_heading_of_the_nearest_stamp_or_the_course(recording):
    driven = heading(with_velocity(recording, [1.0, 0.0, 0.5]), np.pi / 3)
    along = 0.3 * np.cos(np.pi / 3) * np.array([np.cos(np.pi / 3), np.sin(np.pi / 3), 0.0])
    np.testing.assert_allclose(slipped(driven), np.tile(along, (16, 1)), atol=1e-12)
    np.testing.assert_allclose(
        slipped(with_velocity(recording, [3.0, -4.0, 0.5])), np.tile([0.9, -1.2, 0], (16, 1)), atol=1e-12
    )
    driven = heading(with_velocity(recording, [2.0, 0.0, 0.0]), np.pi / 2)
    euler = driven.reference.euler_rad.copy()
    euler[recording.reference.t_s >= 22] = np.nan
    half = dataclasses.replace(driven, reference=dataclasses.replace(driven.reference, euler_rad=euler))
    offset = slipped(half)
    np.testing.assert_allclose(offset[:8], 0, atol=1e-12)  # it heads north and drives east
    np.testing.assert_allclose(offset[8:], np.tile([0.6, 0, 0], (8, 1)), atol=1e-12)
    reference = Reference([0.0, 21.9, 30.0], "r", independent=True, euler_rad=[[0, 0, 0], [0, 0, 0], [0, 0, np.pi / 2]])
    driven = dataclasses.replace(with_velocity(recording, [1.0, 1.0, 0.0]), reference=reference)
    offset = slipped(driven)
    np.testing.assert_allclose(offset, np.tile([0.3, 0, 0], (16, 1)), atol=1e-12)
    late = WheelSlip(windows_s=((27.0, 28.0),)).apply(driven, 0).velocity.mps - driven.velocity.mps
    np.testing.assert_allclose(late[27 * 4 : 28 * 4], np.tile([0, 0.3, 0], (4, 1)), atol=1e-12)


def test_a_wheel_speed_and_a_body_velocity_slip_forwards_in_complete_rows(recording):
    speed = Velocity.along_course(recording.position.t_s, np.full(len(recording.position.t_s), 2.0), 0.1)
    offset = slipped(dataclasses.replace(recording, velocity=speed), slip=-0.5)
    np.testing.assert_allclose(offset[:, 0], -1.0)
    assert np.isnan(offset[:, 1:]).all()
    np.testing.assert_allclose(
        slipped(with_velocity(recording, [2.0, 0.3, 0.1], frame="body"), slip=-0.5), np.tile([-1, 0, 0], (16, 1))
    )
    driven = with_velocity(recording, [2.0, 1.0, 0.5])
    mps = driven.velocity.mps.copy()
    mps[::2, 0] = np.nan
    mps[1::2, 2] = np.nan
    mixed = dataclasses.replace(driven, velocity=dataclasses.replace(driven.velocity, mps=mps))
    offset = slipped(mixed)
    np.testing.assert_array_equal(offset[::2, 1:], 0)
    np.testing.assert_allclose(offset[1::2, :2], np.tile([0.6, 0.3], (8, 1)), atol=1e-12)
    mps[:, 0] = np.nan
    only_north = dataclasses.replace(driven, velocity=dataclasses.replace(driven.velocity, mps=mps))
    with pytest.raises(RecordingError, match="east and north at the same time"):
        WheelSlip().apply(only_north, 0)
