"""Errors that last: a first-order Gauss-Markov process."""

import numpy as np

from jerkbench.arrays import FloatArray


def gauss_markov(t_s: FloatArray, time_s: float, random: np.random.Generator) -> FloatArray:
    """Return a stationary process (m, 3) of unit variance at the times (m,); its axes are independent.

    b_k = c b_{k-1} + sqrt(1 - c^2) w_k,  c = exp(-(t_k - t_{k-1})/time),  w_k ~ N(0, I): exact at any spacing.
    """
    process = random.standard_normal((len(t_s), 3))
    keep = np.exp(-np.diff(t_s) / time_s)
    fresh = np.sqrt(1.0 - keep**2)
    for k in range(1, len(t_s)):
        process[k] = keep[k - 1] * process[k - 1] + fresh[k - 1] * process[k]
    return process
