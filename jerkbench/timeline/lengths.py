"""Lengths of steps: few different ones, but where stamps are uneven."""

import numpy as np

from jerkbench.arrays import FloatArray, IntArray


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
