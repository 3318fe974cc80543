"""What several adaptations share.

In this order: windows of squared innovations, and the inflation of `mtf` and its variants; the chi-square test of an
innovation, and the Gaussian kernel; `Stack`, prior and measurement as one stack that is weighed again and again (the
faithful robust filters); `Measured`, an update in the measured part of the state, from which the covariances of the
whole state follow (the variational filters).

Everything here compiles with numba.
"""

import math
from typing import NamedTuple

import numpy as np

from jerkbench.adaptation.linalg import (
    AXES,
    block_roots,
    dot,
    factorise,
    forward_rows,
    quadratic,
    root_of,
    scaled,
    solve,
    solve_rows,
)
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import anywhere, chosen, each_run

UPDATES_SEEN, HITS_SEEN, NEW_SUMS, RINGS = 0, 6, 12, 18
"""Where the memory of `windowed_mean` begins that has a number of each of the six rows: the updates, the hits in a
sequence (of `inflated`), the sums of the values since each ring was full; then a ring for each row."""


def window_memory(window: int) -> int:
    """Return how many numbers `windowed_mean` remembers."""
    return RINGS + 6 * window


def windowed_mean(memory: FloatArray, window: float, row: int, value: float) -> float:
    """Put ``value`` into the ring of ``row``; return the mean of the last ``window`` values, or of those there are.

    A ring is filled again and again from its begin. Whenever it is full each value becomes the sum of itself and those
    behind it; so what the next ones have not yet replaced is one number, nothing is ever taken away from a sum, and on
    average an update costs the same whatever the window is. ``memory`` has the length `window_memory`, or is longer.
    """
    length, updates = int(window), int(memory[UPDATES_SEEN + row])
    memory[UPDATES_SEEN + row] = updates + 1
    if length == 1:
        return value
    first, place = RINGS + row * length, updates % length
    if place == 0:
        memory[NEW_SUMS + row] = 0.0
        for k in range(first + length - 2, first - 1, -1):
            memory[k] += memory[k + 1]
    memory[first + place] = value
    memory[NEW_SUMS + row] += value
    older = memory[first + place + 1] if place + 1 < length else 0.0
    mean: float = (memory[NEW_SUMS + row] + older) / min(updates + 1, length)
    return mean


def unfilled(memory: FloatArray, window: float, row: int) -> float:
    """Return how many values the ring of ``row`` lacks, 0 or less where it is full."""
    lacking: float = window - memory[UPDATES_SEEN + row]
    return lacking


def inflated(
    innovation: FloatArray,
    HPHt: FloatArray,
    R: FloatArray,
    rows: IntArray,
    memory: FloatArray,
    window: float,
    guard: float,
    triggered: tuple[float, float],
) -> FloatArray:
    """Return R with r_i + max(0, w_i - h_i - r_i) on the diagonal where position, velocity are ``triggered`` (1 or 0).

    ``memory`` has the length `window_memory`.
    """
    remembers = anywhere(window - 1.0 + guard)
    if not (remembers or anywhere(triggered[0] + triggered[1])):
        return R  # nothing to remember, nothing to change: two updates of three
    adapted = R.copy()
    for i, row in enumerate(rows):
        mean = innovation[i] * innovation[i]
        if remembers:
            mean = each_run(windowed_mean, memory, window, row, mean)
        excess = mean - HPHt[i, i] - R[i, i]
        hit = chosen(excess, 0.0, triggered[0] if row < 3 else triggered[1], 0.0)
        if remembers:
            memory[HITS_SEEN + row] = chosen(hit, 0.0, memory[HITS_SEEN + row] + 1.0, 0.0)
            hit *= chosen(guard, 0.0, chosen(memory[HITS_SEEN + row], guard, 0.0, 1.0), 1.0)
        adapted[i, i] += chosen(hit, 0.0, excess, 0.0)
    return adapted


FAR = 1400.0
"""Beyond it every tail for six rows is below 1e-290."""


def position_rows(rows: IntArray) -> int:
    """Return how many rows are of position; those of velocity come behind them."""
    count = 0
    for row in rows:
        if row < 3:
            count += 1
    return count


def innovation_distance(innovation: FloatArray, HPHt: FloatArray, R: FloatArray) -> float:
    """Return y' S^-1 y, S = H P- H' + R."""
    m = len(R)
    room = np.empty((2 * m + 1, m), R.dtype)  # a new array takes longer than the arithmetic of a row
    S, M, v = room[:m], room[m : 2 * m], room[2 * m]
    for i in range(m):
        for j in range(i + 1):
            S[i, j] = HPHt[i, j] + R[i, j]
    factorise(S, M)
    solve(M, innovation, v)
    return dot(innovation, v)


def complementary_error(x: float) -> float:
    """Return erfc(x)."""
    return math.erfc(x)


def chi2_tail(x: float, rows: int) -> float:
    """Return the probability that a chi-square variable with ``rows`` degrees of freedom exceeds ``x``.

    With Q_1 = erfc(sqrt(x/2)) and Q_2 = exp(-x/2), Q_(m+2) = Q_m + (x/2)^(m/2) exp(-x/2)/Gamma(m/2 + 1). So
    x > chi2(p, m) is the same as Q_m(x) < 1 - p, for any p and without a table.
    """
    half = 0.5 * min(x, FAR)
    odd = rows % 2
    tail = each_run(complementary_error, math.sqrt(half)) if odd else math.exp(-half)
    term = 2.0 * math.sqrt(half / math.pi) * math.exp(-half) if odd else half * math.exp(-half)
    for m in range(2 - odd, rows - 1, 2):
        tail += term
        term *= half / (0.5 * m + 1.0)
    return tail


def gaussian_kernel(error: float, bandwidth: float) -> float:
    """Return exp(-e^2/(2 bandwidth^2))."""
    return math.exp(-0.5 * ((error / bandwidth) * (error / bandwidth)))


LARGE = 100.0
"""Its exponential is a number, and larger than the inverse of any weight that is kept."""


def inverse_kernel(error: float, bandwidth: float, smallest: float) -> float:
    """Return the inverse of the same, which is not taken below ``smallest``."""
    return min(math.exp(min(0.5 * ((error / bandwidth) * (error / bandwidth)), LARGE)), 1.0 / smallest)


PASSES = 50
"""After so many the iteration ends, wherever it is."""

CLOSE = 1e-6
"""It ends earlier where the state moves by less than this share of itself."""

MIN_WEIGHT = 1e-8
"""No weight is taken below it, so that covariances stay finite."""

_SEEN = 6
"""Position and velocity come first in every state: rows see no other components of the prior."""


class Stack(NamedTuple):
    """Prior and measurement of an update as one stack: n states, m rows, p = SEEN states or as many as there are.

    With P- = B_p B_p' and R = B_r B_r' (Cholesky) the innovation is::

        y = J r,    J = [H B_p, B_r],    r = [B_p^-1 (x - x-); B_r^-1 (z - H x)]

    r being the whitened stack of any state x. The state of a pass with the weights C has the r of least r' C r::

        S = J C^-1 J' = H P~ H' + R~,    v = S^-1 y,    r = C^-1 J' v,    x = x- + B_p r_p

    H selects from the first six rows of the lower triangle B_p: past them r is zero, and is left out. The weights are
    kept as their inverses, C^-1, because a division takes as long as ten products.

    All is kept by blocks (`jerkbench.adaptation.linalg.AXES`), the first axis of each array; n, m and p are of one.

    Attributes:
        Up: (AXES, p, n) of B_p'.
        columns: (AXES, p + m, m) those of J, one a row.
        shares: (AXES, p + m, m) those of J C^-1.
        y: (AXES, m) innovation.
        inverses: (AXES, p + m) diagonal of C^-1, those of the prior first.
        residual: (AXES, p + m) r.
        S: (AXES, m, m) its lower triangle.
        M: (AXES, m, m) factors of S.
        v: (AXES, m) S^-1 y.
        steps: (2, all states) x - x- of the last pass, and of the one before it.
    """

    Up: FloatArray
    columns: FloatArray
    shares: FloatArray
    y: FloatArray
    inverses: FloatArray
    residual: FloatArray
    S: FloatArray
    M: FloatArray
    v: FloatArray
    steps: FloatArray


def stack_of(P: FloatArray, R: FloatArray, rows: IntArray, innovation: FloatArray) -> Stack:
    """Return the stack before the first pass, with weights of 1."""
    m, p = len(rows) // AXES, min(_SEEN, len(P)) // AXES
    Up, Ur = block_roots(P, p * AXES), block_roots(R, m * AXES)
    both, stacked = np.empty((2, AXES, p + m, m), P.dtype), np.empty((2, AXES, p + m), P.dtype)
    matrices, vectors = np.zeros((2, AXES, m, m), P.dtype), np.empty((2, AXES, m), P.dtype)
    columns, y, steps = both[0], vectors[0], np.zeros((2, len(P)), P.dtype)
    for a in range(AXES):
        for c in range(p + m):
            stacked[0, a, c] = 1.0
        for i in range(m):
            y[a, i] = innovation[a + AXES * i]
            for c in range(p):
                columns[a, c, i] = Up[a, c, rows[a + AXES * i] // AXES]
            for c in range(m):
                columns[a, p + c, i] = Ur[a, c, i]
    return Stack(Up, columns, both[1], y, stacked[0], stacked[1], matrices[0], matrices[1], vectors[1], steps)


def settle(stack: Stack, x: FloatArray) -> float:
    """Make a pass with the weights as they are; return 1, or 0 where it has moved the state by next to nothing."""
    for a in range(AXES):
        _fill_covariance(stack.S[a], stack.columns[a], stack.shares[a], stack.inverses[a], stack.Up.shape[1])
        factorise(stack.S[a], stack.M[a])
        solve(stack.M[a], stack.y[a], stack.v[a])
        for c in range(stack.residual.shape[1]):
            stack.residual[a, c] = dot(stack.shares[a, c], stack.v[a])
    _take_step(stack)
    return still_moves(stack.steps[0], stack.steps[1], x)


def _fill_covariance(S: FloatArray, columns: FloatArray, shares: FloatArray, inverses: FloatArray, p: int) -> None:
    """Fill S; B_p and B_r are lower triangles, so the first rows have no part of the last columns."""
    m = len(S)
    for c in range(p + m):
        for i in range(m):
            shares[c, i] = columns[c, i] * inverses[c]
    for i in range(m):
        for j in range(i + 1):
            total = 0.0
            for c in range(j + 1 + p - m):
                total += shares[c, i] * columns[c, j]
            for c in range(p, p + j + 1):
                total += shares[c, i] * columns[c, j]
            S[i, j] = total


def _take_step(stack: Stack) -> None:
    """Note B_p r_p, and the step before it."""
    step, before = stack.steps[0], stack.steps[1]
    for s in range(len(step)):
        a, moved = s % AXES, 0.0
        for c in range(min(s // AXES + 1, stack.Up.shape[1])):
            moved += stack.Up[a, c, s // AXES] * stack.residual[a, c]
        before[s], step[s] = step[s], moved


def weighed_prior(P: FloatArray, Up: FloatArray, inverses: FloatArray) -> FloatArray:
    """Return P~ = P + B_p (C_p^-1 - 1) B_p' with what a `Stack` has of it."""
    Pw = P.copy()
    for a in range(AXES):
        for s in range(Up.shape[2]):
            for t in range(s + 1):
                total = P[a + AXES * s, a + AXES * t]
                for c in range(min(t + 1, Up.shape[1])):
                    total += (inverses[a, c] - 1.0) * Up[a, c, s] * Up[a, c, t]
                Pw[a + AXES * s, a + AXES * t] = Pw[a + AXES * t, a + AXES * s] = total
    return Pw


def gain_of(stack: Stack) -> FloatArray:
    """Return K = P~ H' S^-1 (n, m) of the last pass."""
    _, p, n = stack.Up.shape
    m = stack.v.shape[1]
    PHt, K = np.zeros((AXES, m, n), stack.v.dtype), np.zeros((n * AXES, m * AXES), stack.v.dtype)
    for a in range(AXES):
        for i in range(m):
            for c in range(p):
                for s in range(c, n):
                    PHt[a, i, s] += stack.shares[a, c, i] * stack.Up[a, c, s]
        solve_rows(stack.M[a], PHt[a], PHt[a])
        for i in range(m):
            for s in range(n):
                K[a + AXES * s, a + AXES * i] = PHt[a, i, s]
    return K


def still_moves(step: FloatArray, before: FloatArray, x: FloatArray) -> float:
    """Return 1, or 0 where a pass has moved the state, x + ``before``, to x + ``step`` by next to nothing of itself."""
    moved = size = 0.0
    for s in range(len(x)):
        moved += (step[s] - before[s]) * (step[s] - before[s])
        size += (x[s] + before[s]) * (x[s] + before[s])
    return chosen(moved, CLOSE * CLOSE * size, 1.0, 0.0)


class Measured(NamedTuple):
    """An update in the m coordinates that are measured: covariances of the whole state follow from it.

    An update changes a covariance in the directions of P- H' alone. So a matrix E that begins as P- and is mixed of P-,
    posteriors and products of steps (x - x-)(x - x-)' remains, with N = H P- H'::

        E = f P- + K0 (W - f N) K0',    K0 = P- H' N^-1,    W = H E H'

    What is not measured follows what is by K0, and of what does not follow it has the f-fold. The update with
    P~ = E / xi and R~ = R / lambda is then one of m rows, with S = W / xi + R~ and v = S^-1 y, and of n states::

        H (x - x-) = W v / xi,                          H posterior H' = W / xi - W S^-1 W / xi^2
        D_x = posterior + (x - x-)(x - x-)',            tr(D_x E^-1) = (n - m + tr(S^-1 R~) + v' W v / xi) / xi
        D_z = H posterior H' + (z - H x)(z - H x)',     tr(D_z R^-1) = (m - tr(S^-1 R~) + v' R v / lambda) / lambda

    Attributes:
        W: (m, m) H E H'.
        R: (m, m) as reported: the array that was given.
        Ur: (m, m) its root, R = Ur' Ur.
        S: (m, m) its lower triangle.
        M: (m, m) factors of S.
        v: (m,) S^-1 y.
        step: (m,) H (x - x-).
        share: (m,) room.
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
    share: FloatArray
    D: FloatArray
    room: FloatArray


def measured_of(P: FloatArray, R: FloatArray, rows: IntArray) -> Measured:
    """Return it before the first pass, x = x- and E = P-."""
    m = len(rows)
    of, vectors = np.empty((5, m, m), P.dtype), np.zeros((3, m), P.dtype)
    for i in range(m):
        for j in range(m):
            of[0, i, j] = of[1, i, j] = P[rows[i], rows[j]]
    return Measured(of[0], R, root_of(R, m), of[2], of[3], vectors[0], vectors[1], vectors[2], of[1], of[4])


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
        for k in range(m):
            part.share[k] = X[k, i] * (part.M[k, k] * by_xi * by_xi)
        for j in range(i + 1):
            left = part.W[i, j] * by_xi + part.step[i] * part.step[j]
            for k in range(m):
                left -= part.share[k] * X[k, j]
            D[i, j] = D[j, i] = left


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


def fill_blend(W: FloatArray, N: FloatArray, tau: float, D: FloatArray, xi: float) -> None:
    """Fill W = (tau N + xi D_x) / (tau + 1), of which one half is worked out."""
    kept, gained = tau / (tau + 1.0), xi / (tau + 1.0)
    for i in range(len(W)):
        for j in range(i + 1):
            W[i, j] = W[j, i] = kept * N[i, j] + gained * D[i, j]


def spread_part(P: FloatArray, rows: IntArray, N: FloatArray, W: FloatArray, share: float) -> FloatArray:
    """Return the whole E (n, n) of its measured part ``W``, of that of P-, ``N``, and of f, its ``share`` of P-.

    It is symmetric to the bit. Of what is measured K0 is the identity, and E is W: K0 is worked out for the other
    states alone.
    """
    n, m = len(P), len(rows)
    M, others, both = np.empty((m, m), P.dtype), _others(n, rows), np.empty((2, m, n - m), P.dtype)
    E: FloatArray = scaled(P, share)
    K, CK = both[0], both[1]
    factorise(N, M)
    for i in range(m):
        for u in range(n - m):
            K[i, u] = P[rows[i], others[u]]
    solve_rows(M, K, K)
    for i in range(m):
        for j in range(m):
            E[rows[i], rows[j]] = W[i, j]
        for u in range(n - m):
            total = 0.0
            for j in range(m):
                total += (W[i, j] - share * N[i, j]) * K[j, u]
            CK[i, u] = total
            E[rows[i], others[u]] = E[others[u], rows[i]] = E[rows[i], others[u]] + total
    for u in range(n - m):
        for v in range(u + 1):
            total = E[others[u], others[v]]
            for i in range(m):
                total += K[i, u] * CK[i, v]
            E[others[u], others[v]] = E[others[v], others[u]] = total
    return E


def _others(states: int, rows: IntArray) -> IntArray:
    """Return the states that no row measures."""
    others, count = np.empty(states - len(rows), np.int64), 0
    for s in range(states):
        measured = False
        for row in rows:
            measured = measured or row == s
        if not measured:
            others[count] = s
            count += 1
    return others
