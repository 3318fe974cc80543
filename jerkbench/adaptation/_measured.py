"""The measured part of the state, H x: covariances of the whole state that an update gives follow from it.

Everything here compiles with numba. An update changes a covariance in the directions of P- H' alone. So a matrix E that
begins as P- and is mixed of P-, posteriors and products of steps (x - x-)(x - x-)' remains, with N = H P- H',

    E = f P- + K0 (W - f N) K0',    K0 = P- H' N^-1,    W = H E H'

what is not measured follows what is by K0, and of what does not follow it has the f-fold. The update with P~ = E / xi
and R~ = R / lambda is then one of m rows, with S = W / xi + R~ and v = S^-1 y, and of n states

    H (x - x-) = W v / xi,                          H posterior H' = W / xi - W S^-1 W / xi^2
    D_x = posterior + (x - x-)(x - x-)',            tr(D_x E^-1) = (n - m + tr(S^-1 R~) + v' W v / xi) / xi
    D_z = H posterior H' + (z - H x)(z - H x)',     tr(D_z R^-1) = (m - tr(S^-1 R~) + v' R v / lambda) / lambda
"""

from typing import NamedTuple

import numpy as np

from jerkbench.adaptation._small import factorise, part_of, quadratic, root_of, solve, solve_rows, squares, whiten_rows
from jerkbench.arrays import FloatArray, IntArray


class Measured(NamedTuple):
    """An update in the m coordinates that are measured.

    Attributes:
        W: (m, m) H E H'.
        R: (m, m) as reported.
        Br: (m, m) its root.
        L: (m, m) root of S.
        v: (m,) S^-1 y.
        step: (m,) H (x - x-).
        D: (m, m) H D_x H'.
        room: (m, m).
    """

    W: FloatArray
    R: FloatArray
    Br: FloatArray
    L: FloatArray
    v: FloatArray
    step: FloatArray
    D: FloatArray
    room: FloatArray


def measured_of(P: FloatArray, R: FloatArray, rows: IntArray) -> Measured:
    """Return it before the first pass, x = x- and E = P-."""
    m = len(rows)
    W = part_of(P, rows)
    return Measured(W, R.copy(), root_of(R), np.zeros((m, m)), np.zeros(m), np.zeros(m), W.copy(), np.empty((m, m)))


def innovate(part: Measured, innovation: FloatArray, xi: float, weight: float) -> None:
    """Find S and v with P~ = E / ``xi`` and R~ = R / ``weight``."""
    by_xi, by_weight = 1.0 / xi, 1.0 / weight
    for i in range(len(part.v)):
        for j in range(i + 1):
            part.L[i, j] = part.W[i, j] * by_xi + part.R[i, j] * by_weight
    factorise(part.L, part.L)
    solve(part.L, innovation, part.v)


def fill_square(part: Measured, xi: float) -> None:
    """Fill the step and D_x after that update."""
    m, X, by_xi = len(part.v), part.room, 1.0 / xi
    whiten_rows(part.L, part.W, X)
    for i in range(m):
        part.step[i] = 0.0
        for j in range(m):
            part.step[i] += part.W[i, j] * part.v[j] * by_xi
    for i in range(m):
        for j in range(i + 1):
            known = 0.0
            for k in range(m):
                known += X[k, i] * X[k, j]
            part.D[i, j] = (part.W[i, j] - known * by_xi) * by_xi + part.step[i] * part.step[j]
            part.D[j, i] = part.D[i, j]


def first_distance(part: Measured, innovation: FloatArray) -> float:
    """Return tr(D_z R^-1) before any update: of N and y."""
    total = 0.0
    solve_rows(part.Br, part.W, part.room)
    for i in range(len(part.v)):
        total += part.room[i, i]
    solve(part.Br, innovation, part.v)
    for i in range(len(part.v)):
        total += part.v[i] * innovation[i]
    return total


def distances(part: Measured, states: int, xi: float, weight: float) -> tuple[float, float]:
    """Return tr(D_x E^-1) and tr(D_z R^-1) after an update."""
    m, left = len(part.v), _noise_share(part) / weight
    g_x = (states - m + left + quadratic(part.W, part.v) / xi) / xi
    return g_x, (m - left + quadratic(part.R, part.v) / weight) / weight


def _noise_share(part: Measured) -> float:
    """Return tr(S^-1 R) = |L^-1 B_r|^2, of two lower triangles."""
    X, L, total = part.room, part.L, 0.0
    for i in range(len(L)):
        for j in range(i + 1):
            rest = part.Br[i, j]
            for k in range(j, i):
                rest -= L[i, k] * X[k, j]
            X[i, j] = rest / L[i, i]
        total += squares(X[i, : i + 1])
    return total


def mix(W: FloatArray, N: FloatArray, tau: float, D: FloatArray, xi: float) -> None:
    """Fill W = (tau N + xi D_x) / (tau + 1)."""
    for i in range(len(W)):
        for j in range(len(W)):
            W[i, j] = (tau * N[i, j] + xi * D[i, j]) / (tau + 1.0)


def spread(P: FloatArray, rows: IntArray, W: FloatArray, share: float) -> FloatArray:
    """Return the whole E (n, n) of its measured part ``W`` and f, its ``share`` of P-; symmetric to the bit."""
    n, m = len(P), len(rows)
    N, K, CK = part_of(P, rows), np.empty((m, n)), np.zeros((m, n))
    for i in range(m):
        K[i] = P[rows[i]]
    solve_rows(root_of(N), K, K)
    for i in range(m):
        for j in range(m):
            change = W[i, j] - share * N[i, j]
            for s in range(n):
                CK[i, s] += change * K[j, s]
    E = share * P
    for i in range(m):
        for s in range(n):
            for t in range(s + 1):
                E[s, t] += K[i, s] * CK[i, t]
    for s in range(n):
        for t in range(s):
            E[t, s] = E[s, t]
    return E
