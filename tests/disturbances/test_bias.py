import numpy as np

from jerkbench.disturbances.imu import ImuBias


def biases(recording, plugin, seed):
    imu = plugin.apply(recording, seed).imu
    accel, gyro = imu.accel_mps2 - recording.imu.accel_mps2, imu.gyro_radps - recording.imu.gyro_radps
    np.testing.assert_allclose(accel, np.tile(accel[0], (len(accel), 1)), atol=1e-12)
    np.testing.assert_allclose(gyro, np.tile(gyro[0], (len(gyro), 1)), atol=1e-12)
    return np.concatenate([accel[0], gyro[0]])


def test_constant_over_the_run_and_of_the_right_size_over_seeds(make):
    recording = make(duration_s=1.0)
    drawn = np.array([biases(recording, ImuBias(), seed) for seed in range(400)])
    sigma = drawn.std(axis=0) / [0.08, 0.08, 0.08, 0.002, 0.002, 0.002]
    np.testing.assert_allclose(sigma, 1, atol=0.15)  # four standard errors of a standard deviation of 400
    assert np.abs(np.corrcoef(drawn.T) - np.eye(6)).max() < 0.2


def test_switching_one_sensor_off_leaves_the_other(recording):
    whole, no_accel = biases(recording, ImuBias(), 5), biases(recording, ImuBias(accel_mps2=0.0), 5)
    np.testing.assert_allclose(no_accel, [0, 0, 0, *whole[3:]], atol=1e-12)
