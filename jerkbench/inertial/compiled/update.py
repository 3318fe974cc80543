"""The measurement update of the error state; `jerkbench.inertial.update` has the equations.

With W = H P and K' = S^-1 W the two halves of the Joseph form are A = P - K W and P = A - (A H' - K R) K', so that an
error of K enters only squared, whatever R is.
"""

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.inertial.compiled.layout import (
    DX,
    H_AT,
    HPHT,
    K_AT,
    P_AT,
    ROW,
    STATES,
    STRIDE,
    W_AT,
    ZERO,
    H,
    K,
    P,
    R,
    S,
    U,
    V,
    W,
    Y,
)

SIX = 6
"""Length of a row of S, R and H P H'."""


def project(w: FloatArray, m: FloatArray, rows: int) -> None:
    """W = H P, and H P H' of the first ``rows`` rows."""
    for r in range(rows):
        for piece in range(ROW):
            w[W + ROW * r + piece] = w[ZERO]
        for state in range(STATES):
            weight = m[H_AT + STRIDE * r + _column(state)]
            if weight != 0.0:
                for piece in range(ROW):
                    w[W + ROW * r + piece] += weight * w[P + ROW * state + piece]
    for r in range(rows):
        for s in range(rows):
            total = 0.0
            for state in range(STATES):
                weight = m[H_AT + STRIDE * s + _column(state)]
                if weight != 0.0:
                    total += weight * m[W_AT + STRIDE * r + _column(state)]
            m[HPHT + SIX * r + s] = total


def _column(state: int) -> int:
    return state if state < 9 else state + 7


def pick(w: FloatArray, m: FloatArray, place: int, row: int) -> None:
    """Move row ``row`` of H and W to ``place``, which is not after it."""
    if place != row:
        for piece in range(ROW):
            w[H + ROW * place + piece] = w[H + ROW * row + piece]
            w[W + ROW * place + piece] = w[W + ROW * row + piece]
        m[Y + place] = m[Y + row]


def distance(m: FloatArray, order: IntArray, rows: int) -> float:
    """Return y' (H P H' + R)^-1 y."""
    _factorise(m, order, rows)
    for i in range(rows):
        total = m[Y + order[i]]
        for j in range(i):
            total -= m[S + SIX * i + j] * m[U + j]
        m[U + i] = total
    for i in range(rows - 1, -1, -1):
        total = m[U + i]
        for j in range(i + 1, rows):
            total -= m[S + SIX * i + j] * m[U + j]
        m[U + i] = total / m[S + 7 * i]
    nis = 0.0
    for i in range(rows):
        nis += m[Y + i] * m[U + i]
    return nis


def _factorise(m: FloatArray, order: IntArray, rows: int) -> None:
    """S = H P H' + R as L U with exchanged rows; an adaptation may return an R that is not symmetric."""
    for i in range(rows):
        order[i] = i
        for j in range(rows):
            m[S + SIX * i + j] = m[HPHT + SIX * i + j] + m[R + SIX * i + j]
    for c in range(rows):
        best = c
        for i in range(c + 1, rows):
            if abs(m[S + SIX * i + c]) > abs(m[S + SIX * best + c]):
                best = i
        if best != c:
            order[c], order[best] = order[best], order[c]
            for j in range(rows):
                m[S + SIX * c + j], m[S + SIX * best + j] = m[S + SIX * best + j], m[S + SIX * c + j]
        scale = 1.0 / m[S + 7 * c]
        for i in range(c + 1, rows):
            factor = m[S + SIX * i + c] * scale
            m[S + SIX * i + c] = factor
            for j in range(c + 1, rows):
                m[S + SIX * i + j] -= factor * m[S + SIX * c + j]


def correct(w: FloatArray, m: FloatArray, order: IntArray, rows: int) -> float:
    """Fill DX from ``rows`` rows of H, W, Y, H P H' and R, update P (not symmetrised); return y' S^-1 y."""
    nis = distance(m, order, rows)
    _fill_gain(w, m, order, rows)
    for piece in range(ROW):
        w[DX + piece] = m[U] * w[W + piece]
        for r in range(1, rows):
            w[DX + piece] += m[U + r] * w[W + ROW * r + piece]
    for state in range(STATES):
        for r in range(rows):
            weight = m[W_AT + STRIDE * r + _column(state)]
            for piece in range(ROW):
                w[P + ROW * state + piece] -= weight * w[K + ROW * r + piece]
    _fill_left(w, m, rows)
    for state in range(STATES):
        for r in range(rows):
            weight = m[K_AT + STRIDE * r + _column(state)]
            for piece in range(ROW):
                w[P + ROW * state + piece] -= weight * w[V + ROW * r + piece]
    return nis


def _fill_gain(w: FloatArray, m: FloatArray, order: IntArray, rows: int) -> None:
    """K' = S^-1 W from the factors of S."""
    for i in range(rows):
        for piece in range(ROW):
            w[K + ROW * i + piece] = w[W + ROW * order[i] + piece]
        for j in range(i):
            for piece in range(ROW):
                w[K + ROW * i + piece] -= m[S + SIX * i + j] * w[K + ROW * j + piece]
    for i in range(rows - 1, -1, -1):
        for j in range(i + 1, rows):
            for piece in range(ROW):
                w[K + ROW * i + piece] -= m[S + SIX * i + j] * w[K + ROW * j + piece]
        scale = 1.0 / m[S + 7 * i]
        for piece in range(ROW):
            w[K + ROW * i + piece] *= scale


def _fill_left(w: FloatArray, m: FloatArray, rows: int) -> None:
    """V = (A H' - K R)'; A lies transposed in the place of P."""
    for r in range(rows):
        for piece in range(ROW):
            w[V + ROW * r + piece] = w[ZERO]
        for state in range(STATES):
            weight = m[H_AT + STRIDE * r + _column(state)]
            if weight != 0.0:
                for piece in range(ROW):
                    w[V + ROW * r + piece] += weight * w[P + ROW * state + piece]
        for q in range(rows):
            for piece in range(ROW):
                w[V + ROW * r + piece] -= m[R + SIX * q + r] * w[K + ROW * q + piece]


def exchange(m: FloatArray) -> None:
    """Turn the rows of P into columns."""
    for r in range(1, STATES):
        for c in range(r):
            a, b = P_AT + STRIDE * r + _column(c), P_AT + STRIDE * c + _column(r)
            m[a], m[b] = m[b], m[a]


def symmetrise(m: FloatArray) -> None:
    """P = (P + P')/2."""
    for r in range(1, STATES):
        for c in range(r):
            a, b = P_AT + STRIDE * r + _column(c), P_AT + STRIDE * c + _column(r)
            m[a] = m[b] = 0.5 * (m[a] + m[b])
