import numpy as np
import pytest

from jerkbench.disturbances.imu import Dropout, ImuBias, ImuVibration
from jerkbench.disturbances.stamps import Jitter
from jerkbench.recording import Imu, Recording, Reference


def at_rest(n=20000, rate_hz=100.0):
    t_s = np.arange(1, n + 1) / rate_hz
    imu = Imu(t_s, np.tile([0, 0, 9.81], (n, 1)), np.zeros((n, 3)))
    return Recording("rest", imu, Reference([1.0], "made up", independent=True))


def vibration(recording, seed=0, **parameters):
    done = ImuVibration(**parameters).apply(recording, seed).imu
    return np.hstack([done.accel_mps2 - recording.imu.accel_mps2, done.gyro_radps - recording.imu.gyro_radps])


def test_vibration_has_its_sigma_and_stays_in_its_band():
    recording = at_rest()
    noise = vibration(recording, accel_mps2=2.0, gyro_radps=0.05, lowest_hz=10.0, highest_hz=20.0)
    np.testing.assert_allclose(noise.std(axis=0) / [2, 2, 2, 0.05, 0.05, 0.05], 1, atol=0.4)
    hz = np.fft.rfftfreq(len(noise), 0.01)
    power = np.abs(np.fft.rfft(noise * np.hanning(len(noise))[:, None], axis=0)) ** 2
    assert power[(hz < 9.9) | (hz > 20.1)].sum() < 1e-4 * power.sum()
    for low in (10.0, 12.5, 15.0, 17.5):  # a quarter of the band each, over all axes
        part = power[(hz >= low) & (hz < low + 2.5)].sum(axis=0) / power.sum(axis=0)
        assert part.mean() == pytest.approx(0.25, abs=0.1)


def test_over_seeds_sigma_is_exact_and_axes_are_independent():
    recording = at_rest(3, 7.0)
    drawn = np.array([vibration(recording, seed, accel_mps2=1.0, gyro_radps=1.0)[1] for seed in range(600)])
    np.testing.assert_allclose(drawn.std(axis=0), 1, atol=0.12)  # four standard errors
    assert abs(np.corrcoef(drawn.T) - np.eye(6)).max() < 0.17
    assert abs((drawn**4).mean(axis=0) / 3 - 1).max() < 0.5  # as a Gaussian's


def test_vibration_is_a_function_of_time():
    recording = at_rest(1000)
    rows = np.arange(1000) % 3 == 0
    holed = Recording("rest", Imu(*(a[rows] for a in vars(recording.imu).values())), recording.reference)
    np.testing.assert_allclose(vibration(holed), vibration(recording)[rows], atol=1e-12)


def test_dropped_samples_are_as_many_and_as_long_as_said():
    recording = at_rest()
    t_s = Dropout(probability=0.02, longest=4).apply(recording, 1).imu.t_s
    gaps = np.round(np.diff(t_s) / 0.01).astype(int) - 1
    assert gaps.max() >= 4
    assert 0.01 < (1 - len(t_s) / 20000) < 0.06  # 0.02 times 2.5, overlaps aside: 0.049
    counts = np.bincount(gaps)[1:5]
    np.testing.assert_allclose(counts / counts.sum(), 0.25, atol=0.08)
    assert t_s[[0, -1]].tolist() == recording.imu.t_s[[0, -1]].tolist()


def test_single_samples_at_a_probability():
    recording = at_rest()
    done = Dropout(probability=0.3, longest=1).apply(recording, 1).imu
    assert 1 - len(done.t_s) / 20000 == pytest.approx(0.3, abs=0.015)
    assert np.isin(done.t_s, recording.imu.t_s).all()
    assert len(Dropout(probability=1.0).apply(recording, 0).imu.t_s) == 2
    assert len(Dropout(probability=0.0).apply(recording, 0).imu.t_s) == 20000


def test_what_is_left_keeps_its_values(recording):
    accel = np.arange(len(recording.imu.t_s))[:, None] * [1.0, 2.0, 3.0]
    numbered = Recording("n", Imu(recording.imu.t_s, accel, -accel), recording.reference)
    done = Dropout(probability=0.2).apply(numbered, 0).imu
    np.testing.assert_allclose(done.accel_mps2[:, 0], done.t_s * 20, atol=1e-9)
    np.testing.assert_array_equal(done.gyro_radps, -done.accel_mps2)


def test_jitter_has_its_sigma_and_leaves_the_values(recording):
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
def test_stamps_go_on_increasing_whatever_the_jitter(seed):
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
