"""The models of all lengths of a step, each made once by the plugin."""

from functools import cache

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.contracts import Filter, ManyLengths
from jerkbench.engines.compiled.arguments import Model
from jerkbench.timeline.timeline import Timeline


def step_lengths(dt_s: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return the different lengths, whole nanoseconds apart, and which of them each step has (-1: none, dt = 0)."""
    if _even(dt_s):
        return _one_length(dt_s)
    key = np.round(dt_s * 1e9).astype(np.int64)
    if _even(key):
        return _one_length(dt_s)
    _, first, which = np.unique(key, return_index=True, return_inverse=True)
    which = which.astype(np.int64)
    which[dt_s <= 0] = -1
    return dt_s[first], which


def _even(dt: FloatArray | IntArray) -> bool:
    """Whether all steps but the first, in which no time passes, are equal; to sort them takes a tenth of a run."""
    return bool(len(dt) > 1 and dt[0] <= 0 < dt[1] and (dt[1:] == dt[1]).all())


def _one_length(dt_s: FloatArray) -> tuple[FloatArray, IntArray]:
    which = np.zeros(len(dt_s), dtype=np.int64)
    which[0] = -1
    return dt_s[1:2], which


def model_of(timeline: Timeline, model: Filter, lengths_s: FloatArray) -> Model:
    """Ask the filter for A, b, Q of each length, and for the start."""
    extra = np.asarray(model.initial_variances(), dtype=np.float64)
    A, b, Q = axis_models(model, lengths_s, timeline.dt0_s)
    x0 = np.concatenate([timeline.x0, np.zeros(3 * len(extra))])
    P0 = np.diag(np.concatenate([np.zeros(6), np.repeat(extra, 3)]))
    P0[:6, :6] = timeline.P0
    return Model(A, b, Q, x0, P0, triangular(A))


def axis_models(model: Filter, lengths_s: FloatArray, dt0_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return A (k, n, n), b (k, n) and Q (k, n, n) of each length; of one that is not positive A is the identity."""
    n, k = 2 + len(model.initial_variances()), len(lengths_s)
    A, b, Q = np.tile(np.eye(n), (k, 1, 1)), np.zeros((k, n)), np.zeros((k, n, n))
    passing = np.flatnonzero(lengths_s > 0)
    if isinstance(model, ManyLengths) and len(passing):
        A[passing], b[passing], Q[passing] = model.axis_models(lengths_s[passing], dt0_s)
        return A, b, Q
    for row in passing.tolist():
        A[row], b[row], Q[row] = model.axis_model(float(lengths_s[row]), dt0_s)
    return A, b, Q


def triangular(A: FloatArray) -> bool:
    """Whether each of (k, n, n) is upper triangular with ones on its diagonal."""
    (rows, columns), identity = _lower(A.shape[1])
    return bool((A[:, rows, columns] == identity).all())


@cache
def _lower(n: int) -> tuple[tuple[IntArray, ...], FloatArray]:
    """Where the lower triangle is, and what the identity has there."""
    below = np.tril_indices(n)
    return below, np.eye(n)[below]
