"""Prior and measurement as one stack, weighed again and again: what faithful robust filters share.

Everything here compiles with numba. With P- = B_p B_p' and R = B_r B_r' (Cholesky) the innovation is

    y = J r,    J = [H B_p, B_r],    r = [B_p^-1 (x - x-); B_r^-1 (z - H x)]

the whitened stack of any state x. The state of a pass with the weights C has the r of least r' C r::

    S = J C^-1 J' = H P~ H' + R~,    v = S^-1 y,    r = C^-1 J' v,    x = x- + B_p r_p

H selects from the first six rows of the lower triangle B_p: past them r is zero, and is left out.
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

SEEN = 6
"""Position and velocity come first in every state: rows see no other components of the prior."""

SIDES = ("both", "measurement")
"""Whom a weight may doubt: prior and measurement, or the measurement alone."""


class Stack(NamedTuple):
    """The stack of an update: n states, m rows, p = SEEN states or as many as there are.

    Attributes:
        Up: (p, n) of B_p'.
        columns: (p + m, m) those of J, one a row.
        y: (m,) innovation.
        weights: (p + m,) diagonal of C, those of the prior first.
        residual: (p + m,) r.
        S: (m, m) its lower triangle.
        M: (m, m) factors of S.
        v: (m,) S^-1 y.
        steps: (2, n) x - x- of the last pass, and of the one before it.
    """

    Up: FloatArray
    columns: FloatArray
    y: FloatArray
    weights: FloatArray
    residual: FloatArray
    S: FloatArray
    M: FloatArray
    v: FloatArray
    steps: FloatArray


def check_sides(name: str, sides: str) -> None:
    """Raise a PluginError where ``sides`` of adaptation ``name`` is none of `SIDES`."""
    if sides not in SIDES:
        raise PluginError(f"{name}.sides: {unknown('value', sides, SIDES)}")


def stack_of(P: FloatArray, R: FloatArray, rows: IntArray, innovation: FloatArray) -> Stack:
    """Return the stack before the first pass, with weights of 1."""
    n, m, p = len(P), len(rows), min(SEEN, len(P))
    Up, Ur = root_of(P, p), root_of(R, m)
    columns, stacked, matrices, v = np.empty((p + m, m)), np.ones((2, p + m)), np.zeros((2, m, m)), np.empty(m)
    for i in range(m):
        for c in range(p):
            columns[c, i] = Up[c, rows[i]]
        for c in range(m):
            columns[p + c, i] = Ur[c, i]
    return Stack(Up, columns, innovation, stacked[0], stacked[1], matrices[0], matrices[1], v, np.zeros((2, n)))


def settle(stack: Stack, x: FloatArray) -> bool:
    """Make a pass with the weights as they are; return whether it has moved the state by next to nothing."""
    _fill_covariance(stack)
    factorise(stack.S, stack.M)
    solve(stack.M, stack.y, stack.v)
    for c in range(len(stack.residual)):
        stack.residual[c] = dot(stack.columns[c], stack.v) / stack.weights[c]
    _take_step(stack)
    return has_settled(stack.steps[0], stack.steps[1], x, stack.steps[1])


def _fill_covariance(stack: Stack) -> None:
    S = stack.S
    for i in range(len(S)):
        for j in range(i + 1):
            S[i, j] = 0.0
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
        moved = 0.0
        for c in range(len(stack.Up)):
            moved += stack.Up[c, s] * stack.residual[c]
        before[s], step[s] = step[s], moved


def weighed_prior(P: FloatArray, stack: Stack) -> FloatArray:
    """Return P~ = P + B_p (C_p^-1 - 1) B_p'."""
    Pw = P.copy()
    for c in range(len(stack.Up)):
        excess = 1.0 / stack.weights[c] - 1.0
        for s in range(c, len(P)):
            share = excess * stack.Up[c, s]
            for t in range(c, len(P)):
                Pw[s, t] += share * stack.Up[c, t]
    return Pw


def gain_of(stack: Stack) -> FloatArray:
    """Return K = P~ H' S^-1 (n, m) of the last pass."""
    n, m = stack.Up.shape[1], len(stack.v)
    HP, K = np.zeros((m, n)), np.empty((n, m))
    for i in range(m):
        for c in range(len(stack.Up)):
            share = stack.columns[c, i] / stack.weights[c]
            for s in range(c, n):
                HP[i, s] += share * stack.Up[c, s]
    solve_rows(stack.M, HP, HP)
    for i in range(m):
        for s in range(n):
            K[s, i] = HP[i, s]
    return K


def doubtable(stack: Stack) -> int:
    """Return p, how many components of the prior the rows may see; the weights of the rows stand behind theirs."""
    return len(stack.Up)


def has_settled(step: FloatArray, before: FloatArray, x: FloatArray, at: FloatArray) -> bool:
    """Whether a pass has moved the state, x plus ``before`` to ``step``, by next to nothing of x + ``at``."""
    moved = size = 0.0
    for s in range(len(x)):
        moved += (step[s] - before[s]) ** 2
        size += (x[s] + at[s]) ** 2
    return bool(moved <= CLOSE * CLOSE * size)
