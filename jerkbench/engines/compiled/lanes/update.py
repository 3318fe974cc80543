"""The measurement update of several runs; see `jerkbench.engines.compiled.gain` for the equations."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import scratch
from jerkbench.compilation.vectors import chosen
from jerkbench.engines.compiled.gain import mahalanobis, moved_by, solve_column, weigh_column
from jerkbench.engines.compiled.lanes.places import SQUARED
from jerkbench.engines.compiled.places import AT, ODD, ROW, K, V, W, X


def correct(w: FloatArray, columns: int) -> float:
    """Update state and covariance with the rows that are kept; return y' S^-1 y."""
    nis = mahalanobis(w)
    for s in range(columns):
        solve_column(w, w, s)
        w[X + s] += moved_by(w, w, s)
        weigh_column(w, w, s)
    for s in range(columns):
        _update_row(w, s)
    return nis


def check_definite(w: FloatArray) -> None:
    """Raise ODD where the covariance has no factors L D L' with D > 0, or the state is no number."""
    C = scratch(SQUARED)
    for s in range(ROW):
        w[ODD] += chosen(1.0, w[X + s] * 0.0, 0.0, 1.0)
        for t in range(s, ROW):
            C[ROW * s + t] = w[AT[s, t]]
    _eliminate(w, C, 0)  # three by three: the compiler unrolls no longer loops, and then C needs no memory
    _eliminate(w, C, 3)
    for c in range(6, ROW, 3):
        _eliminate(w, C, c)


def _eliminate(w: FloatArray, C: FloatArray, first: int) -> None:
    """Eliminate three columns, of the upper triangle; raise ODD where a pivot is not positive."""
    for c in range(first, first + 3):
        w[ODD] += chosen(C[(ROW + 1) * c], 0.0, 0.0, 1.0)
        scale = 1.0 / C[(ROW + 1) * c]
        for r in range(c + 1, ROW):
            factor = C[ROW * c + r] * scale
            for j in range(r, ROW):
                C[ROW * r + j] -= factor * C[ROW * c + j]


def _update_row(w: FloatArray, s: int) -> None:
    """Row ``s`` of P = P - K W - V K', from the diagonal on."""
    a, b, c = w[K + s], w[K + ROW + s], w[K + 2 * ROW + s]
    d, e, f = w[K + 3 * ROW + s], w[K + 4 * ROW + s], w[K + 5 * ROW + s]
    u, v, x = w[V + s], w[V + ROW + s], w[V + 2 * ROW + s]
    y, z, q = w[V + 3 * ROW + s], w[V + 4 * ROW + s], w[V + 5 * ROW + s]
    for t in range(s, ROW):
        first = a * w[W + t] + b * w[W + ROW + t] + c * w[W + 2 * ROW + t]
        second = d * w[W + 3 * ROW + t] + e * w[W + 4 * ROW + t] + f * w[W + 5 * ROW + t]
        third = u * w[K + t] + v * w[K + ROW + t] + x * w[K + 2 * ROW + t]
        fourth = y * w[K + 3 * ROW + t] + z * w[K + 4 * ROW + t] + q * w[K + 5 * ROW + t]
        w[AT[s, t]] = w[AT[s, t]] - (first + second) - (third + fourth)
