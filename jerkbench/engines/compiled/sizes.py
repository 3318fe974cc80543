"""Sizes, and where each part lies in the one array w; a compilation replaces them by those of the filter at hand."""

import itertools


def sizes(n: int) -> dict[str, int]:
    """Return N, S and the offset of each part for a filter with ``n`` quantities on each axis."""
    s = 3 * n
    lengths = {
        "M": 36,  # S = H P H' + R by row of z, then its Cholesky factor
        "INVERSE": 36,  # of an S that has no factor
        "R": 36,  # the adapted R by row of z
        "WHITE": 6,  # L^-1 y
        "Y": 6,  # innovation by row of z, 0 where a row is not there
        "KEPT": 6,  # 1 where a row is used, else 0
        "X": s,  # state
        "MOVED": s,  # F x + B u
        "B": s * s,  # covariance in blocks
        "FB": s * s,  # F P in blocks
        "P": s * s,  # covariance as a square
        "SPARE": s * s,
        "W": 6 * s,  # H P, then (A H' - K R)'
        "K": 6 * s,  # the gain, transposed
        "LENGTH": 0,
    }
    starts = itertools.accumulate(lengths.values(), initial=0)
    return {"N": n, "S": s, **dict(zip(lengths, starts, strict=False))}


N, S, M, INVERSE, R, WHITE, Y, KEPT, X, MOVED, B, FB, P, SPARE, W, K, LENGTH = sizes(3).values()
