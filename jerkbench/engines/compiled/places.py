"""Where each part lies in the array w; a compilation replaces these places by those of the filter at hand.

The kernels in this folder are written for an array of numbers. Two compilations give them vectors instead:

- several runs side by side (`lanes`): every place holds one number of each run;
- one run (`single`): a vector is a piece of a row of a matrix, or holds the same element for all pairs of axes.

A kernel that takes w and m finds rows of matrices in w, and what belongs to the six measured rows in m: in several runs
the same array, in one run an array of vectors and the same memory number by number.
"""

import itertools

import numpy as np

from jerkbench.arrays import IntArray


def places(n: int) -> dict[str, int]:
    """Return sizes and places for a filter with ``n`` quantities on each axis, all parts in one array."""
    s = 3 * n
    lengths = {
        "M": 36,  # S = H P H' + R by row of z; below the diagonal then L of L D L', on it 1/D
        "DIAGONAL": 6,  # of S
        "R": 40,  # the adapted R by row of z, and what is left of the fifth eight
        "WHITE": 6,  # L^-1 y
        "Y": 8,  # innovation by row of z, 0 where a row is not there; two more to make eight
        "KEPT": 8,  # 1 where a row is used, else 0; likewise
        "ODD": 1,  # above 0 where a matrix is not positive definite
        "X": s,  # state
        "B": 6 * n * n,  # covariance by pairs of axes
        "W": 6 * s,  # H P
        "K": 6 * s,  # the gain, transposed
        "V": 6 * s,  # (W' - K S)'
        "LENGTH": 0,
    }
    starts = itertools.accumulate(lengths.values(), initial=0)
    at = dict(zip(lengths, starts, strict=False))
    return {"N": n, "ROW": s, **at}


def square(n: int) -> IntArray:
    """(3n, 3n) where each element of the covariance lies among the pairs of axes; of equal axes half is used."""
    numbers = np.arange(3 * n)
    (a, i), (b, j) = np.divmod(numbers[:, None], 3), np.divmod(numbers, 3)
    swapped = (i > j) | ((i == j) & (a > b))
    a, b = np.where(swapped, b, a), np.where(swapped, a, b)
    i, j = np.minimum(i, j), np.maximum(i, j)
    pair = i * (5 - i) // 2 + j
    return np.asarray(places(n)["B"] + n * n * pair + n * a + b)


N, ROW, M, DIAGONAL, R, WHITE, Y, KEPT, ODD, X, B, W, K, V, LENGTH = places(3).values()
"""ROW: length of a row of W, K, V in w."""
AT = square(3)
HP_AT = AT[:6]
"""(6, ROW) where the elements of H P lie in w."""
PRIOR_AT = AT[:6, :6]
"""(6, 6) where the elements of H P H' lie in m."""
