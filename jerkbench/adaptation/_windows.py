"""Windows of squared innovations, one for each row, and the inflation that `mtf` and its variants share.

The memory holds a ring of ``window`` values for each of the six rows, then six update counts, then (for the
inflation only) six counts of hits. Everything here compiles with numba.
"""

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.errors import PluginError


def check_window(name: str, window: int, guard: int = 0) -> None:
    """Raise a PluginError where the window or the guard of adaptation ``name`` makes no sense."""
    if window < 1:
        raise PluginError(f"{name}.window is {window}; it must be at least 1.")
    if guard < 0:
        raise PluginError(f"{name}.guard is {guard}; it must be 0 (off) or the number of hits that inflate.")


def windowed_mean(memory: FloatArray, window: int, row: int, value: float) -> float:
    """Put ``value`` into the ring of ``row``; return the mean of the last ``window`` values, or of those there are."""
    ring, count = memory[row * window : (row + 1) * window], 6 * window + row
    seen = int(memory[count])
    ring[seen % window] = value
    memory[count] = seen + 1
    return float(np.mean(ring[: min(seen + 1, window)]))


def is_full(memory: FloatArray, window: int, row: int) -> bool:
    """Whether the ring of ``row`` has seen ``window`` values."""
    return bool(memory[6 * window + row] >= window)


def inflation_memory(window: int) -> int:
    """Return how many numbers `inflated` remembers: the rings, the update counts and the hit counts of six rows."""
    return 6 * (window + 2)


def inflated(
    innovation: FloatArray,
    HPHt: FloatArray,
    R: FloatArray,
    rows: IntArray,
    memory: FloatArray,
    window: int,
    guard: int,
    triggered: BoolArray,
) -> FloatArray:
    """Return R with r_i + max(0, w_i - h_i - r_i) on the diagonal of the ``triggered`` (m,) rows.

    ``memory`` has the length `inflation_memory`.
    """
    adapted = R.copy()
    for i, row in enumerate(rows):
        excess = windowed_mean(memory, window, row, innovation[i] ** 2) - HPHt[i, i] - R[i, i]
        hits = 6 * (window + 1) + row
        hit = triggered[i] and excess > 0.0
        memory[hits] = memory[hits] + 1.0 if hit else 0.0
        if hit and (guard == 0 or memory[hits] <= guard):
            adapted[i, i] += excess
    return adapted
