"""Windows of squared innovations, one for each row, and the inflation that `mtf` and its variants share.

The memory holds a ring of ``window`` values for each of the six rows, then six update counts, then (for the
inflation only) six counts of hits. Everything here compiles with numba.
"""

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.errors import PluginError


def check_window(name: str, window: int, guard: int = 0) -> None:
    """Raise a PluginError where the window or the guard of adaptation ``name`` makes no sense."""
    if window < 1:
        raise PluginError(f"{name}.window is {window}; it must be at least 1.")
    if guard < 0:
        raise PluginError(f"{name}.guard is {guard}; it must be 0 (off) or the number of hits that inflate.")


def windowed_mean(memory: FloatArray, window: int, row: int, value: float) -> float:
    """Put ``value`` into the ring of ``row``; return the mean of the last ``window`` values, or of those there are."""
    if window == 1:
        return value
    first, count = row * window, 6 * window + row
    updates = int(memory[count])
    memory[count] = updates + 1
    memory[first + updates % window] = value
    filled, total = min(updates + 1, window), 0.0
    for k in range(first, first + filled):  # compiled, a loop is several times faster than the mean of a slice
        total += memory[k]
    return total / filled


def is_full(memory: FloatArray, window: int, row: int) -> bool:
    """Whether the ring of ``row``, which has seen at least one value, has seen ``window`` of them."""
    return bool(window == 1 or memory[6 * window + row] >= window)


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
    triggered: tuple[bool, bool],
) -> FloatArray:
    """Return R with r_i + max(0, w_i - h_i - r_i) on the diagonal where position or velocity are ``triggered``.

    ``memory`` has the length `inflation_memory`.
    """
    any_triggered = triggered[0] or triggered[1]
    if window == 1 and guard == 0 and not any_triggered:
        return R  # nothing to remember, nothing to change: two updates of three
    adapted = R.copy() if any_triggered else R
    for i, row in enumerate(rows):
        excess = windowed_mean(memory, window, row, innovation[i] ** 2) - HPHt[i, i] - R[i, i]
        hit = (triggered[0] if row < 3 else triggered[1]) and excess > 0.0
        if guard > 0:
            hits = 6 * (window + 1) + row
            memory[hits] = memory[hits] + 1.0 if hit else 0.0
            hit = hit and memory[hits] <= guard
        if hit:
            adapted[i, i] += excess
    return adapted


def squared_length(vector: FloatArray) -> float:
    """Return the sum of the squares; compiled, it makes no array in between."""
    total = 0.0
    for value in vector:
        total += value**2
    return total
