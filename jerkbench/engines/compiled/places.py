"""Where each part lies in the array w; a compilation replaces these places by those of the filter at hand.

The kernels in this folder are written for an array of numbers. Two compilations give them vectors instead:

- several runs side by side (`lanes`): every place holds one number of each run;
- one run (`single`): a vector is a piece of a row of a matrix, or holds the same element for all pairs of axes.

A kernel that takes w and m finds rows of matrices in w, and what belongs to the six measured rows in m: in several runs
the same array, in one run an array of vectors and the same memory number by number.
"""

import itertools


def places(n: int) -> dict[str, int]:
    """Return sizes and places for a filter with ``n`` quantities on each axis, all parts in one array."""
    s = 3 * n
    lengths = {
        "M": 36,  # S = H P H' + R by row of z; below and on the diagonal then its Cholesky factor
        "DIAGONAL": 6,  # of S
        "R": 36,  # the adapted R by row of z
        "WHITE": 6,  # L^-1 y
        "Y": 6,  # innovation by row of z, 0 where a row is not there
        "KEPT": 6,  # 1 where a row is used, else 0
        "ODD": 1,  # above 0 where a matrix has no Cholesky factor
        "X": s,  # state
        "B": s * s,  # covariance by pairs of axes
        "P": s * s,  # covariance as a square
        "W": 6 * s,  # H P
        "K": 6 * s,  # the gain, transposed
        "V": max(6 * s, s * s - 6 * s),  # (W' - K S)'; it and K make room for a covariance as well
        "LENGTH": 0,
    }
    starts = itertools.accumulate(lengths.values(), initial=0)
    at = dict(zip(lengths, starts, strict=False))
    return {"N": n, "ROW": s, "PRIOR": at["P"], "PRIOR_ROW": s, **at}


N, ROW, PRIOR, PRIOR_ROW, M, DIAGONAL, R, WHITE, Y, KEPT, ODD, X, B, P, W, K, V, LENGTH = places(3).values()
"""ROW: length of a row of P, W, K, V in w. PRIOR, PRIOR_ROW: the covariance as m sees it."""
