"""Linear algebra in Decimals: as many digits as the context has, so that rounding plays no part."""

from decimal import Decimal

import numpy as np


def exact(array):
    """The same numbers as Decimals, none of them rounded."""
    return np.vectorize(Decimal, otypes=[object])(np.asarray(array, dtype=float))


def numbers(array):
    return np.array(array, dtype=float)


def solve(S, right):
    """S^-1 right by elimination; S needs no pivots, as where it is positive definite or triangular."""
    S, x = S.copy(), right.copy()
    for c in range(len(S)):
        for r in range(c + 1, len(S)):
            factor = S[r, c] / S[c, c]
            S[r], x[r] = S[r] - factor * S[c], x[r] - factor * x[c]
    for c in reversed(range(len(S))):
        x[c] = (x[c] - S[c, c + 1 :] @ x[c + 1 :]) / S[c, c]
    return x


def cholesky(A):
    """L of A = L L'."""
    L = np.full(A.shape, Decimal(0))
    for c in range(len(A)):
        L[c, c] = (A[c, c] - L[c, :c] @ L[c, :c]).sqrt()
        L[c + 1 :, c] = (A[c + 1 :, c] - L[c + 1 :, :c] @ L[c, :c]) / L[c, c]
    return L
