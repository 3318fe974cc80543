"""Prior and measurement as one stack, weighed again and again: what faithful robust filters share.

Everything here compiles with numba. With P- = B_p B_p' and R = B_r B_r' (Cholesky) the innovation is

    y = J r,    J = [H B_p, B_r],    r = [B_p^-1 (x - x-); B_r^-1 (z - H x)]

the whitened stack of any state x. The state of a pass with the weights C has the r of least r' C r::

    S = J C^-1 J' = H P~ H' + R~,    v = S^-1 y,    r = C^-1 J' v,    x = x- + B_p r_p

H selects from the first rows of the lower triangle B_p: past the last of them r is zero, and is left out.
"""

from typing import NamedTuple

import numpy as np

from jerkbench.adaptation._small import dot, factorise, root_of, solve, solve_rows
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.errors import PluginError, unknown

PASSES = 50
"""After so many the iteration ends, wherever it is."""

CLOSE = 1e-6
"""It ends earlier where the state moves by less than this share of itself."""

SMALLEST_WEIGHT = 1e-8
"""No weight is taken below it, so that covariances stay finite."""

SIDES = ("both", "measurement")
"""Whom a weight may doubt: prior and measurement, or the measurement alone."""


class Stack(NamedTuple):
    """The stack of an update: n states, m rows, p components of the prior that the rows see.

    Attributes:
        Bp: (n, n) root of P-.
        columns: (p + m, m) those of J, one a row.
        weights: (p + m,) diagonal of C, those of the prior first.
        residual: (p + m,) r.
        L: (m, m) root of S.
        v: (m,) S^-1 y.
        steps: (2, n) x - x- of the last pass, and of the one before it.
    """

    Bp: FloatArray
    columns: FloatArray
    weights: FloatArray
    residual: FloatArray
    L: FloatArray
    v: FloatArray
    steps: FloatArray


def check_sides(name: str, sides: str) -> None:
    """Raise a PluginError where ``sides`` of adaptation ``name`` is none of `SIDES`."""
    if sides not in SIDES:
        raise PluginError(f"{name}.sides: {unknown('value', sides, SIDES)}")


def stack_of(P: FloatArray, R: FloatArray, rows: IntArray) -> Stack:
    """Return the stack before the first pass, with weights of 1."""
    n, m, p = len(P), len(rows), rows[-1] + 1
    Bp, Br, columns = root_of(P), root_of(R), np.empty((p + m, m))
    for i in range(m):
        columns[:p, i], columns[p:, i] = Bp[rows[i], :p], Br[i]
    return Stack(Bp, columns, np.ones(p + m), np.zeros(p + m), np.zeros((m, m)), np.zeros(m), np.zeros((2, n)))


def settle(stack: Stack, x: FloatArray, innovation: FloatArray) -> bool:
    """Make a pass with the weights as they are; return whether it has moved the state by next to nothing."""
    _fill_covariance(stack)
    factorise(stack.L, stack.L)
    solve(stack.L, innovation, stack.v)
    for c in range(len(stack.residual)):
        stack.residual[c] = dot(stack.columns[c], stack.v) / stack.weights[c]
    _take_step(stack)
    return has_settled(stack.steps[0], stack.steps[1], x, stack.steps[1])


def _fill_covariance(stack: Stack) -> None:
    """Put S into the place of its root."""
    S = stack.L
    S[:] = 0.0
    for c in range(len(stack.weights)):
        column, inverse = stack.columns[c], 1.0 / stack.weights[c]
        for i in range(len(S)):
            share = column[i] * inverse
            for j in range(i + 1):
                S[i, j] += share * column[j]


def _take_step(stack: Stack) -> None:
    """Note B_p r_p, and the step before it."""
    step, before = stack.steps[0], stack.steps[1]
    for s in range(len(step)):
        before[s], step[s] = step[s], 0.0
        for c in range(min(s + 1, doubtable(stack))):
            step[s] += stack.Bp[s, c] * stack.residual[c]


def doubtable(stack: Stack) -> int:
    """Return p, how many components of the prior the rows see; the weights of the rows stand behind theirs."""
    return len(stack.weights) - len(stack.v)


def weighed_prior(P: FloatArray, stack: Stack) -> FloatArray:
    """Return P~ = P + B_p (C_p^-1 - 1) B_p'."""
    Pw = P.copy()
    for c in range(doubtable(stack)):
        excess = 1.0 / stack.weights[c] - 1.0
        for s in range(c, len(P)):
            share = excess * stack.Bp[s, c]
            for t in range(c, len(P)):
                Pw[s, t] += share * stack.Bp[t, c]
    return Pw


def weighed(L: FloatArray, weights: FloatArray) -> FloatArray:
    """Return L diag(1/weights) L', symmetric to the bit."""
    covariance = np.zeros(L.shape)
    for c in range(len(L)):
        for i in range(c, len(L)):
            for j in range(c, len(L)):
                covariance[i, j] += L[i, c] * L[j, c] / weights[c]
    return covariance


def gain_of(stack: Stack) -> FloatArray:
    """Return K = P~ H' S^-1 (n, m) of the last pass."""
    n, m = len(stack.Bp), len(stack.v)
    HP = np.zeros((m, n))
    for c in range(doubtable(stack)):
        for i in range(m):
            share = stack.columns[c, i] / stack.weights[c]
            for s in range(c, n):
                HP[i, s] += share * stack.Bp[s, c]
    solve_rows(stack.L, HP, HP)
    return HP.T.copy()


def has_settled(step: FloatArray, before: FloatArray, x: FloatArray, at: FloatArray) -> bool:
    """Whether a pass has moved the state, x plus ``before`` to ``step``, by next to nothing of x + ``at``."""
    moved = size = 0.0
    for s in range(len(x)):
        moved += (step[s] - before[s]) ** 2
        size += (x[s] + at[s]) ** 2
    return bool(np.sqrt(moved) <= CLOSE * np.sqrt(size))
