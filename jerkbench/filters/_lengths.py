"""Models of one axis for many lengths of a step at once: an IMU with uneven stamps has as many as samples."""

import numpy as np

from jerkbench.arrays import FloatArray

Models = tuple[FloatArray, FloatArray, FloatArray]
"""A (k, n, n), b (k, n), Q (k, n, n)."""


class ManyLengths:
    """A filter that writes its model down for all lengths; that of one length is one of them."""

    def axis_models(self, dt: FloatArray, dt0: float) -> Models:
        """Return A (k, n, n), b (k, n), Q (k, n, n) for steps of ``dt`` (k,) seconds."""
        raise NotImplementedError

    def axis_model(self, dt: float, dt0: float) -> Models:
        """Return A (n, n), b (n,), Q (n, n) for a step of ``dt`` seconds."""
        A, b, Q = self.axis_models(np.array([dt]), dt0)
        return A[0], b[0], Q[0]


def identities(dt: FloatArray, n: int) -> FloatArray:
    """Return the identity (k, n, n) for each of ``dt`` (k,)."""
    return np.tile(np.eye(n), (len(dt), 1, 1))


def outer(scale: FloatArray, b: FloatArray) -> FloatArray:
    """Return scale b b' (k, n, n) of each ``scale`` (k,) and ``b`` (k, n)."""
    return np.asarray(scale[:, None, None] * (b[:, :, None] * b[:, None, :]))
