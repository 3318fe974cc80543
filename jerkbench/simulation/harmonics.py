"""Sums of sines, with their derivatives."""

import numpy as np

from jerkbench.arrays import FloatArray


def harmonics(
    x: FloatArray, frequency: FloatArray, sine: FloatArray, cosine: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return y_c = sum_w a_cw sin(k_w x) + b_cw cos(k_w x), and dy_c/dx, both (n, c).

    Args:
        x: (n,) time or distance.
        frequency: (w,) k, in radians per unit of x.
        sine: (c, w) a.
        cosine: (c, w) b.
    """
    phase = np.multiply.outer(x, frequency)
    sines, cosines = np.sin(phase), np.cos(phase)
    value = _weigh(sines, sine) + _weigh(cosines, cosine)
    return value, _weigh(cosines, frequency * sine) - _weigh(sines, frequency * cosine)


def _weigh(waves: FloatArray, weights: FloatArray) -> FloatArray:
    # einsum, not @: so small a product only loses by the threads of BLAS, most of all when a sweep fills the cores
    return np.asarray(np.einsum("nw,cw->nc", waves, weights))
