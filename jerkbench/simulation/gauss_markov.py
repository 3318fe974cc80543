"""Errors that last: a first-order Gauss-Markov process."""

import numpy as np

from jerkbench.arrays import FloatArray


def gauss_markov(t_s: FloatArray, time_s: float, random: np.random.Generator, axes: int = 3) -> FloatArray:
    """Return a stationary process (m, axes) of unit variance at the times (m,); its axes are independent.

    b_k = c b_{k-1} + sqrt(1 - c^2) w_k,  c = exp(-(t_k - t_{k-1})/time),  w_k ~ N(0, I): exact at any spacing.
    """
    process = random.standard_normal((len(t_s), axes))
    keep = np.exp(-np.diff(t_s) / time_s)
    fresh = np.sqrt(1.0 - keep**2)
    for k in range(1, len(t_s)):
        process[k] = keep[k - 1] * process[k - 1] + fresh[k - 1] * process[k]
    return process


def coloured(
    t_s: FloatArray, white: FloatArray, share: float, time_s: float, random: np.random.Generator
) -> FloatArray:
    """Return noise (m, k) of unit variance, of which ``share`` is a Gauss-Markov process and the rest ``white`` (m, k).

    n = sqrt(1 - share) w + sqrt(share) b,  so that E[n(t) n(t + tau)] = share exp(-|tau|/time) for tau > 0.
    """
    if not share:
        return white
    slow = gauss_markov(t_s, time_s, random, white.shape[1])
    return np.asarray(np.sqrt(1.0 - share) * white + np.sqrt(share) * slow)
