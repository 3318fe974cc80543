"""The measurement update, in a form that rounding harms no more than it must.

With W = H P, S = H P H' + R and v = S^-1 y it holds for the states that are measured that

    x + K y = x + W' v = x + y - R v
    posterior = P - W' S^-1 W = R - R S^-1 R = R S^-1 W

The factors of S are those of S + E, |E_ij| < eps sqrt(S_ii S_jj), and A' S^-1 B errs by A' S^-1 E S^-1 B: the smaller A
and B, the less, and nothing large is to be taken away from anything large (after a gap P may be 1e12 R). So each state
has a column G of its own, that of R where it is measured and R < P, else that of W, and with Z = S^-1 G

    x = x + y - G' v,    x + G' v,    posterior = R - G' Z,    P - G' Z,    G' Z

for two states of the first kind, two of the second, and one of each. Rounding is told from information as in
`jerkbench.kalman`.
"""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import scratch
from jerkbench.compilation.vectors import chosen, vectors
from jerkbench.kalman import EXPOSED, FLOOR, INDEFINITE, ROUNDING
from jerkbench.kinematic.gain import solve_column, solve_innovation, solve_measured
from jerkbench.kinematic.layout import (
    AT,
    DIAGONAL,
    DOUBT,
    ELEMENT,
    FINE,
    KEPT,
    LOST,
    SOLVED,
    SQUARED,
    WIDTH,
    K,
    M,
    N,
    R,
    S,
    W,
    X,
    Y,
)

BOUND = 4.0 * EXPOSED
"""More than (1 + e) EXPOSED (`_may_be_rounding`)."""


def correct(w: FloatArray, columns: int) -> None:
    """Update state and covariance with the rows that are used.

    ``columns`` is the number of states: as a constant it would make the compiler unroll the loops, and use the stack
    for what no longer fits into registers.
    """
    solve_innovation(w)
    for r in range(6):
        w[FINE + r] = chosen(w[KEPT + r] * w[AT[r, r]], w[R + 7 * r], 1.0, 0.0)
    for s in range(6):
        solve_measured(w, s)
    for s in range(6, columns):
        solve_column(w, s)
    taken_from = scratch(S, WIDTH)
    for s in range(S):
        taken_from[s] = w[AT[s, s]]
    for s in range(6):
        taken_from[s] = chosen(w[FINE + s], 0.0, w[R + 7 * s], w[AT[s, s]])
    _correct_measured(w)
    _correct_others(w, columns)
    if _may_be_rounding(w, taken_from):
        _widen(w, taken_from)
    if WIDTH == 1:
        mirror(w)


def _correct_measured(w: FloatArray) -> None:
    """Position and velocity."""
    for s in range(6):
        moved = _times(w, W + s, S)
        w[X + s] += chosen(w[FINE + s], 0.0, w[Y + s] - moved, moved)
        for t in range(s + 1):
            _update_measured(w, s, t)


def _correct_others(w: FloatArray, columns: int) -> None:
    """The states that are not measured, among each other and with position and velocity."""
    for s in range(6, columns):
        w[X + s] += _times(w, W + s, S)
        for t in range(6):
            product = _product(w, s, t)
            w[AT[s, t]] = chosen(w[FINE + t], 0.0, product, w[AT[s, t]] - product)
        for t in range(6, s):
            w[AT[s, t]] = w[AT[s, t]] - _product(w, s, t)
        w[AT[s, s]] = w[AT[s, s]] - _product(w, s, s)


def _update_measured(w: FloatArray, s: int, t: int) -> None:
    """The covariance of two of the states of position and velocity, s >= t."""
    prior, product = w[AT[s, t]], _product(w, s, t)
    mixed = chosen(w[FINE + s] + w[FINE + t], 0.0, product, prior - product)
    w[AT[s, t]] = chosen(w[FINE + s] * w[FINE + t], 0.0, w[R + 6 * s + t] - product, mixed)


def _may_be_rounding(w: FloatArray, taken_from: FloatArray) -> bool:
    """Whether `_widen` may have something to do, of a run that is not lost.

    Of G' Z = Z' S Z = ``taken_from`` - posterior, with C the matrix of S's correlations and of m rows, it holds that

        sum_i Z_i^2 S_ii <= Z' S Z / eigenvalue(C),    eigenvalue(C) >= det C ((m - 1) / m)^(m - 1) > det C / e

    because the other eigenvalues of C have a mean of at most m / (m - 1). So what the posterior is left of is less than
    (1 + e) / det C times ``taken_from``.
    """
    factor: float = BOUND * w[M] * w[DIAGONAL]
    for r in range(1, 6):
        factor *= w[M + 7 * r] * w[DIAGONAL + r]
    doubt: float = w[LOST] * 0.0
    for s in range(S):
        doubt += chosen(w[AT[s, s]], factor * taken_from[s], 0.0, 1.0)
    w[DOUBT] = chosen(w[LOST], 0.0, 0.0, doubt)
    numbers, total = vectors(w, 1), 0.0
    for run in range(WIDTH):
        total += numbers[WIDTH * DOUBT + run]
    return total > 0.0


def _widen(w: FloatArray, taken_from: FloatArray) -> None:
    """Add rounding to the variances (`jerkbench.kalman.spread_by`); raise LOST where one is nothing else."""
    lost = w[LOST]
    for s in range(S):
        variance, spread = w[AT[s, s]], taken_from[s]
        if s < 6:
            spread = (1.0 - w[FINE + s]) * spread
        for i in range(6):
            spread += w[K + S * i + s] * w[K + S * i + s] * w[DIAGONAL + i]
        lost += chosen(variance, ROUNDING * spread, 0.0, 1.0)
        w[AT[s, s]] = variance + chosen(EXPOSED * spread, variance, FLOOR * spread, 0.0)
    w[LOST] = lost


def mirror(w: FloatArray) -> None:
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


def _product(w: FloatArray, s: int, t: int) -> float:
    """G' S^-1 G of two states."""
    g, z = W + t, K + s
    first: float = w[z] * w[g] + w[z + S] * w[g + S] + w[z + 2 * S] * w[g + 2 * S]
    second: float = w[z + 3 * S] * w[g + 3 * S] + w[z + 4 * S] * w[g + 4 * S]
    third: float = second + w[z + 5 * S] * w[g + 5 * S]
    return first + third


def check_definite(w: FloatArray) -> None:
    """Raise LOST where the covariance has no factors L D L' with D > 0 but for rounding, or the state is no number."""
    C, lost = scratch(SQUARED, WIDTH), w[LOST]
    for s in range(S):
        lost += chosen(1.0, w[X + s] * 0.0, 0.0, 1.0)
        for t in range(s, S):
            C[S * s + t] = w[AT[s, t]]
        C[(S + 1) * s] *= 1.0 + INDEFINITE
    lost = _eliminate(C, 0, lost)  # three by three: the compiler unrolls no longer loops, and then C needs no memory
    lost = _eliminate(C, 3, lost)
    for c in range(6, S, 3):
        lost = _eliminate(C, c, lost)
    w[LOST] = lost


def _eliminate(C: FloatArray, first: int, lost: float) -> float:
    """Eliminate three columns, of the upper triangle; return ``lost``, and more where a pivot is not positive."""
    for c in range(first, first + 3):
        lost += chosen(C[(S + 1) * c], 0.0, 0.0, 1.0)
        scale = 1.0 / C[(S + 1) * c]
        for r in range(c + 1, S):
            factor = C[S * c + r] * scale
            for j in range(r, S):
                C[S * r + j] -= factor * C[S * c + j]
    return lost
