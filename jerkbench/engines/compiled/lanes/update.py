"""The measurement update of several runs; see `jerkbench.engines.compiled.gain` for the equations."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vectors import chosen
from jerkbench.engines.compiled.gain import mahalanobis, moved_by, solve_column, weigh_column
from jerkbench.engines.compiled.places import ODD, ROW, K, P, V, W, X


def correct(w: FloatArray) -> float:
    """Update state and covariance with the rows that are kept; return y' S^-1 y."""
    nis = mahalanobis(w)
    for s in range(ROW):
        solve_column(w, w, s)
        w[X + s] += moved_by(w, w, s)
        weigh_column(w, w, s)
    for s in range(ROW):
        _update_row(w, s)
    return nis


def check_definite(w: FloatArray) -> None:
    """Raise ODD where the covariance has no Cholesky factor, or the state is no number; spoils K and V."""
    for s in range(ROW):
        for t in range(s, ROW):
            w[K + ROW * s + t] = w[P + ROW * s + t]
    for c in range(ROW):
        pivot = w[K + (ROW + 1) * c]
        w[ODD] += chosen(pivot, 0.0, w[X + c] * 0.0, 1.0)
        scale = 1.0 / pivot
        for r in range(c + 1, ROW):
            factor = w[K + ROW * c + r] * scale
            for j in range(r, ROW):
                w[K + ROW * r + j] -= factor * w[K + ROW * c + j]


def _update_row(w: FloatArray, s: int) -> None:
    """Row ``s`` of P = P - K W - V K', from the diagonal on, and its mirror."""
    a, b, c = w[K + s], w[K + ROW + s], w[K + 2 * ROW + s]
    d, e, f = w[K + 3 * ROW + s], w[K + 4 * ROW + s], w[K + 5 * ROW + s]
    u, v, x = w[V + s], w[V + ROW + s], w[V + 2 * ROW + s]
    y, z, q = w[V + 3 * ROW + s], w[V + 4 * ROW + s], w[V + 5 * ROW + s]
    for t in range(s, ROW):
        first = a * w[W + t] + b * w[W + ROW + t] + c * w[W + 2 * ROW + t]
        second = d * w[W + 3 * ROW + t] + e * w[W + 4 * ROW + t] + f * w[W + 5 * ROW + t]
        third = u * w[K + t] + v * w[K + ROW + t] + x * w[K + 2 * ROW + t]
        fourth = y * w[K + 3 * ROW + t] + z * w[K + 4 * ROW + t] + q * w[K + 5 * ROW + t]
        value = w[P + ROW * s + t] - (first + second) - (third + fourth)
        w[P + ROW * s + t] = value
        w[P + ROW * t + s] = value
