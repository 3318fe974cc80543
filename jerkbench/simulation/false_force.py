"""Specific force that the accelerometer feels though the robot does not move so: ruts and impacts.

It is sampled inside the accelerometer, at m times within each of its n samples.
"""

import numpy as np

from jerkbench.arrays import FloatArray

IMPACT_S = 0.02


def inner_times(t_s: FloatArray, per_sample: int) -> FloatArray:
    """Times (n, m) in the middle of ``per_sample`` parts of each interval; ``t_s`` (n + 1,) are the interval's ends."""
    parts = (np.arange(per_sample) + 0.5) / per_sample
    times: FloatArray = t_s[:-1, None] + np.diff(t_s)[:, None] * parts
    return times


def rut_force(
    inner_s: FloatArray, times_s: tuple[float, ...], force_mps2: tuple[float, ...], decay_s: float
) -> FloatArray:
    """Return (n, m, 3): ``force_mps2`` from each time on, decaying as exp(-t/``decay_s``)."""
    size = np.zeros_like(inner_s)
    for start in times_s:
        since = inner_s - start
        size += np.where(since >= 0.0, np.exp(-np.maximum(since, 0.0) / decay_s), 0.0)
    force: FloatArray = size[:, :, None] * np.asarray(force_mps2)
    return force


def draw_impacts(rng: np.random.Generator, per_s: float, begin_s: float, end_s: float) -> FloatArray:
    """Draw the times of a Poisson process between two times, sorted."""
    length = max(0.0, end_s - begin_s)
    return np.sort(begin_s + length * rng.uniform(size=rng.poisson(per_s * length)))


def impact_force(inner_s: FloatArray, times_s: FloatArray, peak_mps2: float) -> FloatArray:
    """Return (n, m, 3): at each time a half sine of 20 ms, upwards in the body."""
    force = np.zeros((inner_s.size, 3))
    flat = inner_s.ravel()
    for start in times_s:
        hit = slice(*np.searchsorted(flat, (start, start + IMPACT_S)))
        force[hit, 2] += peak_mps2 * np.sin(np.pi * (flat[hit] - start) / IMPACT_S)
    return force.reshape(*inner_s.shape, 3)
