"""The models of all lengths of a step, each made once by the plugin."""

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.contracts import Filter
from jerkbench.engines.compiled.arguments import Model
from jerkbench.timeline.timeline import Timeline


def step_lengths(dt_s: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the different lengths, whole nanoseconds apart, and which of them each step has (-1: none, dt = 0)."""
    key = np.round(dt_s * 1e9).astype(np.int64)
    if (
        len(key) > 1 and dt_s[0] <= 0 < dt_s[1] and (key[1:] == key[1]).all()
    ):  # sorting takes as long as a tenth of a run
        which = np.zeros(len(key), dtype=np.int64)
        which[0] = -1
        return dt_s[1:2], which
    _, first, which = np.unique(key, return_index=True, return_inverse=True)
    which = which.astype(np.int64)
    which[dt_s <= 0] = -1
    return dt_s[first], which


def model_of(timeline: Timeline, model: Filter, lengths_s: FloatArray) -> Model:
    """Ask the filter for A, b, Q of each length, and for the start."""
    extra = np.asarray(model.initial_variances(), dtype=np.float64)
    n = 2 + len(extra)
    A, b, Q = np.zeros((len(lengths_s), n, n)), np.zeros((len(lengths_s), n)), np.zeros((len(lengths_s), n, n))
    for k, dt in enumerate(lengths_s.tolist()):
        if dt > 0:
            A[k], b[k], Q[k] = model.axis_model(dt, timeline.dt0_s)
    x0 = np.concatenate([timeline.x0, np.zeros(3 * n - 6)])
    P0 = np.diag(np.concatenate([np.zeros(6), np.repeat(extra, 3)]))
    P0[:6, :6] = timeline.P0
    return Model(A, b, Q, x0, P0, bool(_triangular(A[lengths_s > 0]).all()))


def _triangular(A: FloatArray) -> BoolArray:
    """(k,) whether A is upper triangular with ones on its diagonal."""
    n = A.shape[1]
    return np.asarray((np.tril(A) == np.eye(n)).all(axis=(1, 2)))
