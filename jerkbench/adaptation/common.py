"""Functions that several adaptations use, with loops that numba compiles.

The module contains the following groups of functions and classes, in this order::

    base classes
    the mean of the last squared innovations, and the inflation of `mtf` and its variants
    the chi-square test of an innovation, and the Gaussian kernel
    `Stack`, the whitened residuals of prior and measurement, for robust filters that weight both
    `MeasuredUpdate`, an iterated update that computes only the measured states, for the variational filters
"""

import math
from typing import NamedTuple

import numpy as np

from jerkbench.adaptation.linalg import (
    dot,
    factorise,
    forward_rows,
    quadratic,
    root_of,
    scaled,
    solve,
    solve_rows,
    trace,
)
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.lanes import anywhere, each_run, select
from jerkbench.kalman import submatrix
from jerkbench.parameters import Limited


class UnchangedR:
    """Base class of adaptations that do not change R."""

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return R unchanged."""
        return R


UPDATE_COUNTS, HIT_COUNTS, RING_SUMS, RINGS = 0, 6, 12, 18
"""Start indices in the memory of `windowed_mean`. Each part of the memory has values for six rows: the number of
updates, the number of consecutive hits (used by `inflated`), the sum of the values since the ring buffer was last full,
and the ring buffers."""


class Windowed(Limited):
    """Base class of adaptations that use the mean of the last ``window`` squared innovations (`windowed_mean`)."""

    window: int

    def memory_size(self) -> int:
        """Return the length of the memory that `windowed_mean` needs for six rows."""
        return RINGS + 6 * self.window


def windowed_mean(memory: FloatArray, window: float, row: int, value: float) -> float:
    """Add ``value`` to the ring buffer of ``row``, and return the mean of the last ``window`` values.

    If fewer than ``window`` values were added, the result is the mean of all values. When the buffer is full, each
    element is replaced by the sum of this element and all later elements, and the buffer is filled from the start
    again. One element then contains the sum of all old values that have not been overwritten. No value is ever
    subtracted from a sum, and the average cost of an update does not depend on the window length. The array ``memory``
    must have at least the length that `Windowed.memory_size` returns.
    """
    length, updates = int(window), int(memory[UPDATE_COUNTS + row])
    memory[UPDATE_COUNTS + row] = updates + 1
    if length == 1:
        return value
    start, index = RINGS + row * length, updates % length
    if index == 0:
        memory[RING_SUMS + row] = 0.0
        for k in range(start + length - 2, start - 1, -1):
            memory[k] += memory[k + 1]
    memory[start + index] = value
    memory[RING_SUMS + row] += value
    previous = memory[start + index + 1] if index + 1 < length else 0.0
    mean: float = (memory[RING_SUMS + row] + previous) / min(updates + 1, length)
    return mean


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
    """Return R, with inflated variances in the rows of position or velocity if their test has triggered.

    The inflated variance of row i is r_i + max(0, w_i - h_i - r_i), with the result w_i of `windowed_mean`, h_i = (H P-
    H')_ii and r_i = R_ii. The tuple ``triggered`` contains one number for position and one for velocity: 1 if the test
    has triggered, otherwise 0. The array ``memory`` is the memory of `windowed_mean`.
    """
    uses_memory = anywhere(window - 1.0 + guard)
    if not (uses_memory or anywhere(triggered[0] + triggered[1])):
        return R  # avoids a copy in about two thirds of the updates
    adapted = R.copy()
    for i, row in enumerate(rows):
        mean = innovation[i] * innovation[i]
        if uses_memory:
            mean = each_run(windowed_mean, memory, window, row, mean)
        excess = mean - HPHt[i, i] - R[i, i]
        hit = select(excess, 0.0, triggered[0] if row < 3 else triggered[1], 0.0)
        if uses_memory:
            memory[HIT_COUNTS + row] = select(hit, 0.0, memory[HIT_COUNTS + row] + 1.0, 0.0)
            hit *= select(guard, 0.0, select(memory[HIT_COUNTS + row], guard, 0.0, 1.0), 1.0)
        adapted[i, i] += select(hit, 0.0, excess, 0.0)
    return adapted


def position_rows(rows: IntArray) -> int:
    """Return the number of position rows among the measured ``rows``. The position rows precede the velocity rows."""
    count = 0
    for row in rows:
        if row < 3:
            count += 1
    return count


def innovation_distance(innovation: FloatArray, HPHt: FloatArray, R: FloatArray) -> float:
    """Return the squared Mahalanobis distance y' S^-1 y of the innovation y, with S = H P- H' + R."""
    m = len(R)
    buffer = np.empty((2 * m + 1, m), R.dtype)  # one buffer, because each allocation is slow
    S, M, v = buffer[:m], buffer[m : 2 * m], buffer[2 * m]
    for i in range(m):
        for j in range(i + 1):
            S[i, j] = HPHt[i, j] + R[i, j]
    factorise(S, M)
    solve(M, innovation, v)
    return dot(innovation, v)


MAX_DISTANCE = 1400.0
"""Upper limit of the argument of `chi2_tail`. With up to six rows, larger values have a probability below 1e-290."""


def chi2_tail(x: float, rows: int) -> float:
    """Return the probability that a chi-square variable with ``rows`` degrees of freedom exceeds ``x``.

    The probability Q_m is computed by the recursion Q_(m+2) = Q_m + (x/2)^(m/2) exp(-x/2)/Gamma(m/2 + 1), which starts
    with Q_1 = erfc(sqrt(x/2)) or Q_2 = exp(-x/2). A test computes Q_m(x) < 1 - p, which is equivalent to x > chi2(p, m)
    but needs no quantile.
    """
    half = 0.5 * min(x, MAX_DISTANCE)
    odd = rows % 2
    tail = each_run(math.erfc, math.sqrt(half)) if odd else math.exp(-half)
    term = 2.0 * math.sqrt(half / math.pi) * math.exp(-half) if odd else half * math.exp(-half)
    for m in range(2 - odd, rows - 1, 2):
        tail += term
        term *= half / (0.5 * m + 1.0)
    return tail


def gaussian_kernel(error: float, bandwidth: float) -> float:
    """Return the Gaussian kernel exp(-e^2/(2 bandwidth^2)) of the error e."""
    return math.exp(-0.5 * ((error / bandwidth) * (error / bandwidth)))


MAX_LOG_INVERSE = 100.0
"""Upper limit of the exponent in `inverse_kernel`. The number exp(100) is finite and exceeds every inverse weight."""


def inverse_kernel(error: float, bandwidth: float, minimum: float) -> float:
    """Return the inverse of the Gaussian kernel of ``error``, limited to 1 / ``minimum``."""
    return min(math.exp(min(0.5 * ((error / bandwidth) * (error / bandwidth)), MAX_LOG_INVERSE)), 1.0 / minimum)


MAX_ITERATIONS = 50
"""Maximum number of passes of an iteration that does not converge."""

STATE_TOLERANCE = 1e-6
"""An iteration has converged if the state changes by less than this fraction of the norm of the state."""

MIN_WEIGHT = 1e-8
"""Smallest weight, so that the weighted covariances remain finite."""

MEASURED_STATES = 6
"""Number of position and velocity states. They are the first states of every filter, and only they are measured."""


class Stack(NamedTuple):
    """Whitened residuals of prior and measurement, for n states and m measured rows.

    The weighted update minimises the weighted sum of the squared residuals. The residuals r of a state x are whitened
    with the Cholesky factors of P- = B_p B_p' and R = B_r B_r'::

        r = [B_p^-1 (x - x-); B_r^-1 (z - H x)],    J = [H B_p, B_r],    J r = z - H x- = y

    A pass with the weights C computes the state with the smallest r' C r::

        S = J C^-1 J' = H P~ H' + R~,    v = S^-1 y,    r = C^-1 J' v,    x = x- + B_p r_p

    Only the first p = min(6, n) states can be measured, and B_p is lower triangular, so only the first p elements of
    r_p can differ from zero. Only these elements are stored. The inverse weights C^-1 are stored instead of the
    weights, because a division takes as long as ten products.

    Attributes:
        Up: (p, n) first p rows of the transposed Cholesky factor B_p'.
        Jt: (p + m, m) transposed matrix J'.
        CJt: (p + m, m) product C^-1 J'.
        y: (m,) innovation of the measured rows.
        inverses: (p + m,) diagonal of C^-1, with the inverse weights of the prior first.
        residual: (p + m,) whitened residuals r.
        S: (m, m) weighted innovation covariance S, of which only the lower triangle is computed.
        M: (m, m) factors L and D of S = L D L'.
        v: (m,) weighted innovation S^-1 y.
        step: (n,) change x - x- of the state in the last pass.
    """

    Up: FloatArray
    Jt: FloatArray
    CJt: FloatArray
    y: FloatArray
    inverses: FloatArray
    residual: FloatArray
    S: FloatArray
    M: FloatArray
    v: FloatArray
    step: FloatArray


def stack_of(P: FloatArray, R: FloatArray, rows: IntArray, innovation: FloatArray) -> Stack:
    """Return the residuals and matrices before the first pass, with all weights equal to 1."""
    m, p = len(rows), min(MEASURED_STATES, len(P))
    Up, Ur, v, step = root_of(P, p), root_of(R, m), np.empty(m, P.dtype), np.zeros(len(P), P.dtype)
    J, vectors, S = np.empty((2, p + m, m), P.dtype), np.empty((2, p + m), P.dtype), np.empty((2, m, m), P.dtype)
    for c in range(p + m):
        vectors[0, c] = 1.0
    for i in range(m):
        for c in range(p):
            J[0, c, i] = Up[c, rows[i]]
        for c in range(m):
            J[0, p + c, i] = Ur[c, i]
    return Stack(Up, J[0], J[1], innovation, vectors[0], vectors[1], S[0], S[1], v, step)


def solve_stack(stack: Stack, x: FloatArray) -> float:
    """Compute one pass with the current weights. Return 0 if the state has converged, otherwise 1."""
    _fill_covariance(stack)
    factorise(stack.S, stack.M)
    solve(stack.M, stack.y, stack.v)
    for c in range(len(stack.residual)):
        stack.residual[c] = dot(stack.CJt[c], stack.v)
    return take_step(stack.step, stack.Up, stack.residual, x)


def _fill_covariance(stack: Stack) -> None:
    """Compute C^-1 J' and the lower triangle of S.

    H B_p and B_r are lower triangular, so the last columns of J do not affect the first rows of S.
    """
    S, Jt, CJt, m, p = stack.S, stack.Jt, stack.CJt, len(stack.S), len(stack.Up)
    for c in range(p + m):
        for i in range(m):
            CJt[c, i] = Jt[c, i] * stack.inverses[c]
    for i in range(m):
        for j in range(i + 1):
            total = 0.0
            for c in range(j + 1 + p - m):
                total += CJt[c, i] * Jt[c, j]
            for c in range(p, p + j + 1):
                total += CJt[c, i] * Jt[c, j]
            S[i, j] = total


def take_step(step: FloatArray, B: FloatArray, r: FloatArray, x: FloatArray) -> float:
    """Replace ``step``, which is x - x- of the previous pass, by B' r.

    Returns 0 if the state has converged, otherwise 1.
    """
    change = norm = 0.0
    for s in range(len(x)):
        total = 0.0
        for c in range(len(B)):
            total += B[c, s] * r[c]
        change += (total - step[s]) * (total - step[s])
        norm += (x[s] + step[s]) * (x[s] + step[s])
        step[s] = total
    return select(change, STATE_TOLERANCE * STATE_TOLERANCE * norm, 1.0, 0.0)


def weighted_prior(P: FloatArray, stack: Stack) -> FloatArray:
    """Return the exactly symmetric weighted prior covariance P~ = P + B_p (C_p^-1 - 1) B_p'."""
    Pw, Up = np.empty(P.shape, P.dtype), stack.Up
    for s in range(len(P)):
        for t in range(s + 1):
            total = P[s, t]
            for c in range(min(t + 1, len(Up))):
                total += (stack.inverses[c] - 1.0) * Up[c, s] * Up[c, t]
            Pw[s, t] = Pw[t, s] = total
    return Pw


def gain_of(stack: Stack) -> FloatArray:
    """Return the Kalman gain K = P~ H' S^-1 (n, m) of the last pass."""
    HP = np.zeros((len(stack.S), len(stack.step)), stack.v.dtype)
    for i in range(len(stack.S)):
        for c in range(len(stack.Up)):
            for s in range(c, len(stack.step)):
                HP[i, s] += stack.CJt[c, i] * stack.Up[c, s]
    solve_rows(stack.M, HP, HP)
    return HP.T


class MeasuredUpdate(NamedTuple):
    """An iterated update of n states that computes only the m measured states.

    The function `full_covariance` computes the covariance of all states after the last pass. An update changes a
    covariance only in the directions of P- H', so the measured states determine the full covariance. Let E be a linear
    combination of P-, posterior covariances and products (x - x-)(x - x-)'. In all directions other than P- H', E is
    equal to f P- with a factor f. The matrix E is determined by f, N = H P- H' and W = H E H'::

        E = f P- + K0 (W - f N) K0',    K0 = P- H' N^-1,    W = H E H'

    The update with P~ = E / xi and R~ = R / lambda needs only the matrix S = W / xi + R~ (m, m) and v = S^-1 y (m,)::

        H (x - x-) = W v / xi,                          H posterior H' = W / xi - W S^-1 W / xi^2
        D_x = posterior + (x - x-)(x - x-)',            tr(D_x E^-1) = (n - m + tr(S^-1 R~) + v' W v / xi) / xi
        D_z = H posterior H' + (z - H x)(z - H x)',     tr(D_z R^-1) = (m - tr(S^-1 R~) + v' R v / lambda) / lambda

    Attributes:
        W: (m, m) covariance H E H' of the measured states.
        R: (m, m) reported measurement covariance (the array of the caller, not a copy).
        Ur: (m, m) upper triangular root of R.
        S: (m, m) innovation covariance S, of which only the lower triangle is computed.
        M: (m, m) factors L and D of S = L D L'.
        v: (m,) weighted innovation S^-1 y.
        step: (m,) change H (x - x-) of the measured states.
        D: (m, m) matrix H D_x H'.
        X: (m, m) buffer for intermediate matrices.
        b: (m,) buffer for intermediate vectors.
    """

    W: FloatArray
    R: FloatArray
    Ur: FloatArray
    S: FloatArray
    M: FloatArray
    v: FloatArray
    step: FloatArray
    D: FloatArray
    X: FloatArray
    b: FloatArray


def measured_update(P: FloatArray, R: FloatArray, rows: IntArray) -> MeasuredUpdate:
    """Return the arrays of the update before the first pass, with x = x- and E = P-."""
    m, W = len(rows), submatrix(P, rows)
    matrices, vectors = np.empty((3, m, m), P.dtype), np.zeros((3, m), P.dtype)
    S, M, X = matrices[0], matrices[1], matrices[2]
    return MeasuredUpdate(W, R, root_of(R, m), S, M, vectors[0], vectors[1], W.copy(), X, vectors[2])


def fill_solution(update: MeasuredUpdate, innovation: FloatArray, xi: float, weight: float) -> None:
    """Compute S and v = S^-1 y of the update with P~ = E / ``xi`` and R~ = R / ``weight``."""
    by_xi, by_weight = 1.0 / xi, 1.0 / weight
    for i in range(len(update.v)):
        for j in range(i + 1):
            update.S[i, j] = update.W[i, j] * by_xi + update.R[i, j] * by_weight
    factorise(update.S, update.M)
    solve(update.M, innovation, update.v)


def fill_square(update: MeasuredUpdate, xi: float) -> None:
    """Compute the step H (x - x-) and D = H D_x H' after a call of `fill_solution`."""
    W, X, D, step, by_xi = update.W, update.X, update.D, update.step, 1.0 / xi
    forward_rows(update.M, W, X)
    for i in range(len(W)):
        step[i] = dot(W[i], update.v) * by_xi
        for k in range(len(W)):
            update.b[k] = X[k, i] * (update.M[k, k] * by_xi * by_xi)
        for j in range(i + 1):
            square = W[i, j] * by_xi + step[i] * step[j]
            for k in range(len(W)):
                square -= update.b[k] * X[k, j]
            D[i, j] = D[j, i] = square


def initial_trace(update: MeasuredUpdate, innovation: FloatArray) -> float:
    """Return tr(D_z R^-1) before the first pass, where D_z = H P- H' + y y'."""
    factorise(update.R, update.M)
    solve_rows(update.M, update.W, update.X)
    solve(update.M, innovation, update.v)
    total = trace(update.X)
    for i in range(len(innovation)):
        total += update.v[i] * innovation[i]
    return total


def whitened_traces(update: MeasuredUpdate, states: int, xi: float, weight: float) -> tuple[float, float]:
    """Return tr(D_x E^-1) and tr(D_z R^-1) after a call of `fill_solution`."""
    m, noise = len(update.v), _noise_trace(update) / weight
    g_x = (states - m + noise + quadratic(update.W, update.v) / xi) / xi
    return g_x, (m - noise + quadratic(update.R, update.v) / weight) / weight


def _noise_trace(update: MeasuredUpdate) -> float:
    """Return tr(S^-1 R), which is computed as the sum of the squares of the elements of D^-1/2 L^-1 Ur'."""
    X, M, Ur, total = update.X, update.M, update.Ur, 0.0
    for i in range(len(X)):
        row = 0.0
        for j in range(i + 1):
            rest = Ur[j, i]
            for k in range(j, i):
                rest -= M[i, k] * X[k, j]
            X[i, j] = rest
            row += rest * rest
        total += row * M[i, i]
    return total


def fill_mixture(W: FloatArray, N: FloatArray, tau: float, D: FloatArray, xi: float) -> None:
    """Compute the exactly symmetric matrix W = (tau N + xi D_x) / (tau + 1)."""
    prior, posterior = tau / (tau + 1.0), xi / (tau + 1.0)
    for i in range(len(W)):
        for j in range(i + 1):
            W[i, j] = W[j, i] = prior * N[i, j] + posterior * D[i, j]


def full_covariance(P: FloatArray, rows: IntArray, N: FloatArray, W: FloatArray, f: float) -> FloatArray:
    """Return the exactly symmetric covariance E (n, n) of all states.

    For the measured states, K0 is the identity matrix and E is equal to W. Therefore K0 (see `MeasuredUpdate`) is
    computed only for the states that are not measured.
    """
    n, m = len(P), len(rows)
    M, others, products = np.empty((m, m), P.dtype), _others(n, rows), np.empty((2, m, n - m), P.dtype)
    E: FloatArray = scaled(P, f)
    K, CK = products[0], products[1]
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
                total += (W[i, j] - f * N[i, j]) * K[j, u]
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
    """Return the indices of the states that are not measured."""
    others, count = np.empty(states - len(rows), np.int64), 0
    for s in range(states):
        for row in rows:
            if row == s:
                break
        else:
            others[count] = s
            count += 1
    return others
