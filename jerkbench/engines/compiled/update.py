"""The measurement update, in a form that rounding harms no more than it must.

With W = H P, S = H P H' + R, v = S^-1 y and K' = S^-1 W it holds for the states that are measured that

    x + K y = x + W' v = x + y - R v,    P - K W = K R

and where R < P the right one takes nothing large away from anything large, as the left one does after a gap: P may be
1e12 R then. Of two measured states s, t either (K R)_st or (K R)_ts is the covariance: the better one is that whose R
is the smaller part of its S. Rounding is told from information as in `jerkbench.kalman`.
"""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import scratch
from jerkbench.compilation.vectors import chosen
from jerkbench.engines.compiled.gain import solve_column, solve_innovation
from jerkbench.engines.compiled.layout import (
    AT,
    DIAGONAL,
    ELEMENT,
    FINE,
    KEPT,
    LOST,
    PRIOR,
    SOLVED,
    SQUARED,
    WIDTH,
    K,
    N,
    R,
    S,
    W,
    X,
    Y,
)
from jerkbench.kalman import ROUNDING


def correct(w: FloatArray, columns: int) -> None:
    """Update state and covariance with the rows that are used.

    ``columns`` is the number of states: as a constant it would make the compiler unroll the loops, and use the stack
    for what no longer fits into registers.
    """
    solve_innovation(w)
    for s in range(columns):
        solve_column(w, s)
    for r in range(6):
        w[PRIOR + r] = w[KEPT + r] * w[AT[r, r]]
        w[FINE + r] = chosen(w[PRIOR + r], w[R + 7 * r], 1.0, 0.0)
    for s in range(6):
        w[X + s] += chosen(w[FINE + s], 0.0, w[Y + s] - _times(w, R + 6 * s, 1), _times(w, W + s, S))
        for t in range(s + 1):
            _update_measured(w, s, t)
    for s in range(6, columns):
        w[X + s] += _times(w, W + s, S)
        for t in range(6):
            spread = w[AT[s, t]] - _gain_times(w, s, W + t, S)
            w[AT[s, t]] = chosen(w[FINE + t], 0.0, _gain_times(w, s, R + 6 * t, 1), spread)
        for t in range(6, s):
            w[AT[s, t]] = w[AT[s, t]] - _gain_times(w, s, W + t, S)
        prior = w[AT[s, s]]
        w[AT[s, s]] = prior - _gain_times(w, s, W + s, S)
        w[LOST] += chosen(w[AT[s, s]], ROUNDING * prior, 0.0, 1.0)
    if WIDTH == 1:
        _mirror(w)


def _update_measured(w: FloatArray, s: int, t: int) -> None:
    """The covariance of two of the states of position and velocity, s >= t."""
    prior = w[AT[s, t]]
    left, right = _gain_times(w, s, R + 6 * t, 1), _gain_times(w, t, R + 6 * s, 1)
    finer = chosen(w[PRIOR + t] * w[DIAGONAL + s], w[PRIOR + s] * w[DIAGONAL + t], left, right)
    w[AT[s, t]] = chosen(w[FINE + s] + w[FINE + t], 0.0, finer, prior - _gain_times(w, s, W + t, S))
    if s == t:
        w[LOST] += chosen(w[AT[s, s]], ROUNDING * (1.0 - w[KEPT + s]) * prior, 0.0, 1.0 - w[KEPT + s])


def _mirror(w: FloatArray) -> None:
    """Fill the other half of the covariance of an axis with itself, where all pairs are predicted alike."""
    for i in range(3):
        for a in range(1, N):
            for b in range(a):
                e = AT[3 * b + i, 3 * a + i]
                w[e + ELEMENT * (N - 1) * (a - b)] = w[e]


def _times(w: FloatArray, at: int, step: int) -> float:
    """Six numbers times v."""
    first: float = w[at] * w[SOLVED] + w[at + step] * w[SOLVED + 1] + w[at + 2 * step] * w[SOLVED + 2]
    second: float = w[at + 3 * step] * w[SOLVED + 3] + w[at + 4 * step] * w[SOLVED + 4]
    third: float = second + w[at + 5 * step] * w[SOLVED + 5]
    return first + third


def _gain_times(w: FloatArray, s: int, at: int, step: int) -> float:
    """Row ``s`` of K times six numbers."""
    first: float = w[K + s] * w[at] + w[K + S + s] * w[at + step] + w[K + 2 * S + s] * w[at + 2 * step]
    second: float = w[K + 3 * S + s] * w[at + 3 * step] + w[K + 4 * S + s] * w[at + 4 * step]
    third: float = second + w[K + 5 * S + s] * w[at + 5 * step]
    return first + third


def check_definite(w: FloatArray) -> None:
    """Raise LOST where the covariance has no factors L D L' with D > 0, or the state is no number."""
    C = scratch(SQUARED, WIDTH)
    for s in range(S):
        w[LOST] += chosen(1.0, w[X + s] * 0.0, 0.0, 1.0)
        for t in range(s, S):
            C[S * s + t] = w[AT[s, t]]
    _eliminate(w, C, 0)  # three by three: the compiler unrolls no longer loops, and then C needs no memory
    _eliminate(w, C, 3)
    for c in range(6, S, 3):
        _eliminate(w, C, c)


def _eliminate(w: FloatArray, C: FloatArray, first: int) -> None:
    """Eliminate three columns, of the upper triangle; raise LOST where a pivot is not positive."""
    for c in range(first, first + 3):
        w[LOST] += chosen(C[(S + 1) * c], 0.0, 0.0, 1.0)
        scale = 1.0 / C[(S + 1) * c]
        for r in range(c + 1, S):
            factor = C[S * c + r] * scale
            for j in range(r, S):
                C[S * r + j] -= factor * C[S * c + j]
