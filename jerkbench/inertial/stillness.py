"""The times at which the vehicle stands still, as the IMU sees it."""

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.recording import Imu


def still_samples(imu: Imu, window_s: float, accel_mps2: float, gyro_radps: float) -> BoolArray:
    """Return (n,) whether the vehicle has stood still for the ``window_s`` that end with each sample.

    It does where the standard deviations over the window, of the three axes together, are below both limits: what is
    constant (gravity, a bias) does not count. Steady motion on a smooth road looks the same, so a user of this asks
    for a small speed as well. The first window has too few samples to tell: False.
    """
    samples = max(round(window_s / imu.nominal_interval_s), 2)
    quiet = deviation(imu.accel_mps2, samples) < accel_mps2
    return np.asarray(quiet & (deviation(imu.gyro_radps, samples) < gyro_radps))


def deviation(values: FloatArray, samples: int) -> FloatArray:
    """Return (n,) the root of the summed variances of the columns over the last ``samples`` rows; infinite before."""
    centred = values - values.mean(axis=0)  # less cancellation in the running sums
    spread = np.full(len(values), np.inf)
    if len(values) < samples:
        return spread
    mean, square = _running_mean(centred, samples), _running_mean(centred**2, samples)
    spread[samples - 1 :] = np.sqrt(np.maximum(square - mean**2, 0.0).sum(axis=1))
    return spread


def _running_mean(values: FloatArray, samples: int) -> FloatArray:
    sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values, axis=0)])
    return np.asarray((sums[samples:] - sums[:-samples]) / samples)
