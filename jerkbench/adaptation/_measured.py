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

from jerkbench.adaptation._small import dot, factorise, forward_rows, part_of, quadratic, root_of, solve, solve_rows
from jerkbench.arrays import FloatArray, IntArray


class Measured(NamedTuple):
    """An update in the m coordinates that are measured.

    Attributes:
        W: (m, m) H E H'.
        R: (m, m) as reported.
        Ur: (m, m) its root, R = Ur' Ur.
        S: (m, m) its lower triangle.
        M: (m, m) factors of S.
        v: (m,) S^-1 y.
        step: (m,) H (x - x-).
        D: (m, m) H D_x H'.
        room: (m, m).
    """

    W: FloatArray
    R: FloatArray
    Ur: FloatArray
    S: FloatArray
    M: FloatArray
    v: FloatArray
    step: FloatArray
    D: FloatArray
    room: FloatArray


def measured_of(P: FloatArray, R: FloatArray, rows: IntArray) -> Measured:
    """Return it before the first pass, x = x- and E = P-."""
    m = len(rows)
    W, room, vectors = part_of(P, rows), np.empty((3, m, m)), np.zeros((2, m))
    return Measured(W, R.copy(), root_of(R, m), room[0], room[1], vectors[0], vectors[1], W.copy(), room[2])


def innovate(part: Measured, innovation: FloatArray, xi: float, weight: float) -> None:
    """Find S and v with P~ = E / ``xi`` and R~ = R / ``weight``."""
    by_xi, by_weight = 1.0 / xi, 1.0 / weight
    for i in range(len(part.v)):
        for j in range(i + 1):
            part.S[i, j] = part.W[i, j] * by_xi + part.R[i, j] * by_weight
    factorise(part.S, part.M)
    solve(part.M, innovation, part.v)


def fill_square(part: Measured, xi: float) -> None:
    """Fill the step and D_x after that update."""
    m, X, D, by_xi = len(part.v), part.room, part.D, 1.0 / xi
    forward_rows(part.M, part.W, X)
    for i in range(m):
        part.step[i] = dot(part.W[i], part.v) * by_xi
    for i in range(m):
        for j in range(m):
            D[i, j] = part.W[i, j] * by_xi + part.step[i] * part.step[j]
    for k in range(m):
        scale = part.M[k, k] * by_xi * by_xi
        for i in range(m):
            share = X[k, i] * scale
            for j in range(m):
                D[i, j] -= share * X[k, j]


def first_distance(part: Measured, innovation: FloatArray) -> float:
    """Return tr(D_z R^-1) before any update: of N and y."""
    total = 0.0
    factorise(part.R, part.M)
    solve_rows(part.M, part.W, part.room)
    for i in range(len(part.v)):
        total += part.room[i, i]
    solve(part.M, innovation, part.v)
    for i in range(len(part.v)):
        total += part.v[i] * innovation[i]
    return total


def distances(part: Measured, states: int, xi: float, weight: float) -> tuple[float, float]:
    """Return tr(D_x E^-1) and tr(D_z R^-1) after an update."""
    m, left = len(part.v), _noise_share(part) / weight
    g_x = (states - m + left + quadratic(part.W, part.v) / xi) / xi
    return g_x, (m - left + quadratic(part.R, part.v) / weight) / weight


def _noise_share(part: Measured) -> float:
    """Return tr(S^-1 R), of two lower triangles."""
    X, M, Ur, total = part.room, part.M, part.Ur, 0.0
    for i in range(len(part.v)):
        row = 0.0
        for j in range(i + 1):
            rest = Ur[j, i]
            for k in range(j, i):
                rest -= M[i, k] * X[k, j]
            X[i, j] = rest
            row += rest * rest
        total += row * M[i, i]
    return total


def mix(W: FloatArray, N: FloatArray, tau: float, D: FloatArray, xi: float) -> None:
    """Fill W = (tau N + xi D_x) / (tau + 1)."""
    for i in range(len(W)):
        for j in range(len(W)):
            W[i, j] = (tau * N[i, j] + xi * D[i, j]) / (tau + 1.0)


def spread(P: FloatArray, rows: IntArray, W: FloatArray, share: float) -> FloatArray:
    """Return the whole E (n, n) of its measured part ``W`` and f, its ``share`` of P-; symmetric to the bit."""
    n, m = len(P), len(rows)
    N, M, K, CK = part_of(P, rows), np.empty((m, m)), np.empty((m, n)), np.zeros((m, n))
    factorise(N, M)
    for i in range(m):
        for s in range(n):
            K[i, s] = P[rows[i], s]
    solve_rows(M, K, K)
    for i in range(m):
        for j in range(m):
            change = W[i, j] - share * N[i, j]
            for s in range(n):
                CK[i, s] += change * K[j, s]
    return _joined(P, K, CK, share)


def _joined(P: FloatArray, K: FloatArray, CK: FloatArray, share: float) -> FloatArray:
    """Return f P + K' CK, of which one half is worked out."""
    E = np.empty(P.shape)
    for s in range(len(P)):
        for t in range(s + 1):
            E[s, t] = share * P[s, t]
        for i in range(len(K)):
            for t in range(s + 1):
                E[s, t] += K[i, s] * CK[i, t]
        for t in range(s):
            E[t, s] = E[s, t]
    return E
