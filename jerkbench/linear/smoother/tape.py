"""The tape: filtered states, and what each update made of them."""

from jerkbench.arrays import FloatArray
from jerkbench.compilation.vector_ops import scratch
from jerkbench.compilation.vectors import chosen
from jerkbench.kinematic.layout import FINE, KEPT, SOLVED, WIDTH, B, K, M, S, X
from jerkbench.linear.smoother.layout import COVARIANCE_LENGTH, INVERSE, LEFT, STATE, WEIGHED


def write_state(w: FloatArray, rows: FloatArray, at: int) -> None:
    """Write the filtered state from number ``at`` of ``rows`` on."""
    for e in range(COVARIANCE_LENGTH):
        rows[at + e] = w[B + e]
    for s in range(S):
        rows[at + STATE + s] = w[X + s]


def read_state(rows: FloatArray, at: int, w: FloatArray) -> None:
    """Read it again."""
    for e in range(COVARIANCE_LENGTH):
        w[B + e] = rows[at + e]
    for s in range(S):
        w[X + s] = rows[at + STATE + s]


def write_update(w: FloatArray, rows: FloatArray, at: int) -> None:
    """Write I - K H, S^-1 and S^-1 y of the update that ``w`` has just seen.

    Column s of K' = S^-1 H P lies in K; of a measured state whose R is the finer, it is that of S^-1 R, which is what
    is left of one (see `jerkbench.kinematic.correction`).
    """
    for r in range(6):
        for s in range(S):
            rest = (1.0 if r == s else 0.0) - w[K + S * r + s]
            if s < 6:
                rest = chosen(w[FINE + s], 0.0, w[K + S * r + s], rest)
            rows[at + LEFT + S * r + s] = rest
        rows[at + WEIGHED + r] = w[SOLVED + r]
    _write_inverse(w, rows, at + INVERSE)


def _write_inverse(w: FloatArray, rows: FloatArray, at: int) -> None:
    """S^-1 = L^-1' D^-1 L^-1 from the factors of S; 0 where a row is not used."""
    inner = scratch(36, WIDTH)
    for c in range(6):
        inner[7 * c] = w[KEPT + c]
        for r in range(c + 1, 6):
            rest = 0.0 - w[M + 6 * r + c] * inner[7 * c]
            for j in range(c + 1, r):
                rest -= w[M + 6 * r + j] * inner[6 * j + c]
            inner[6 * r + c] = rest
    for i in range(6):
        for j in range(i + 1):
            total = inner[7 * i] * w[M + 7 * i] * inner[6 * i + j]
            for r in range(i + 1, 6):
                total += inner[6 * r + i] * w[M + 7 * r] * inner[6 * r + j]
            rows[at + i * (i + 1) // 2 + j] = total
