"""The places of the parts of a run in the array w; a compilation replaces them by those of the filter at hand.

Every place holds one number of each run. The covariance alone lies in two ways: of one run the six pairs of axes stand
side by side, because one vector then holds the same element of all of them; of several runs each pair has a matrix.
"""

import itertools
from functools import cache

import numpy as np

from jerkbench.arrays import IntArray
from jerkbench.compilation.vectors import WIDE

AXES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
"""The pairs of axes."""

WEIGHTS = ("counted", "whole", "moving", "both")
"""What a row of the reference counts for; the weights of a row stand in this order."""

TOTALS = (
    *("EAST", "NORTH", "UP", "WHOLE", "VEAST", "VNORTH", "VUP", "NEES", "NEES_POSITION", "OUTAGE"),
    *("LARGEST", "FARTHEST", "NIS", "UPDATES", "NIS_USED", "UPDATES_USED"),
)
"""What is summed up over a run; LARGEST and FARTHEST are maxima of squares."""


@cache
def layout(n: int, width: int) -> dict[str, int]:
    """Return sizes and places for ``width`` runs of a filter with ``n`` quantities on each axis."""
    s, alone = 3 * n, width == 1
    lengths = {
        "B": n * n * (WIDE if alone else len(AXES)),  # covariance by pairs of axes
        "SAME": WIDE,  # of one run: 1 for a pair of an axis with itself
        "M": 36,  # S = H P H' + R by row of z; below the diagonal then L of L D L', on it 1/D
        "DIAGONAL": 6,  # of S
        "R": 40,  # the adapted R by row of z, and what is left of the fifth eight
        "WHITE": 6,  # L^-1 y
        "SOLVED": 6,  # S^-1 y
        "Y": 8,  # innovation by row of z, 0 where a row is not used; two more to make eight
        "KEPT": 8,  # 1 where a row is used, else 0; likewise
        "VARIANCE": 8,  # diagonal of R, also of a row that it leaves out; NaN where there is none
        "FINE": 6,  # 1 where a row is used and its R is less than H P H', else 0
        "X": s,  # state
        "W": 6 * s,  # G: H P, or R in the columns of the finer rows
        "K": 6 * s,  # S^-1 G
        "DOUBT": 1,  # above 0 where what an update leaves of a variance may be rounding
        "LOST": 1,  # above 0 once a matrix was not positive definite
        "ENDED": 1,  # row of z at which that was, or -1
        "E": 6,  # error of position and velocity
        "SQUARE": 1,  # of the position error
        **dict.fromkeys(TOTALS, 1),
        "LENGTH": 0,
    }
    starts = itertools.accumulate(lengths.values(), initial=0)
    sizes = {"WIDTH": width, "N": n, "S": s, "SIZE": n * n, "SQUARED": s * s}
    strides = {"ELEMENT": WIDE if alone else 1, "PAIR": 1 if alone else n * n}
    return {**sizes, **strides, **dict(zip(lengths, starts, strict=False))}


@cache
def tables(n: int, width: int) -> dict[str, IntArray]:
    """Return where elements of the covariance lie, for the same."""
    at = _square(n, width)
    return {"AT": at, "EIGHTS": np.resize(at[:6, :6], (5, 8))}


def _square(n: int, width: int) -> IntArray:
    """(3n, 3n) where each element of the covariance lies; of equal axes half is used."""
    numbers, places = np.arange(3 * n), layout(n, width)
    (a, i), (b, j) = np.divmod(numbers[:, None], 3), np.divmod(numbers, 3)
    swapped = (i > j) | ((i == j) & (a > b))
    a, b = np.where(swapped, b, a), np.where(swapped, a, b)
    i, j = np.minimum(i, j), np.maximum(i, j)
    pair = i * (5 - i) // 2 + j
    return np.asarray(places["B"] + places["PAIR"] * pair + places["ELEMENT"] * (n * a + b))


def _eight_of_measured(first: int) -> tuple[int, ...]:
    """Return where numbers ``first`` to ``first`` + 7 of the (6, 6) covariance of position and velocity lie in one run.

    Counted from the first of four vectors of pairs: position with position, position with velocity, velocity with
    position, velocity with velocity.
    """
    places = _square(2, 1) - layout(2, 1)["B"]
    return tuple(places.ravel()[first : first + WIDE].tolist())


FIRST_EIGHT, SECOND_EIGHT, THIRD_EIGHT, FOURTH_EIGHT, LAST_EIGHT = map(_eight_of_measured, (0, 8, 16, 24, 28))
_PLACES, _TABLES = layout(3, WIDE), tables(3, WIDE)
WIDTH, N, S, SIZE, SQUARED, ELEMENT, PAIR = (
    _PLACES[k] for k in ("WIDTH", "N", "S", "SIZE", "SQUARED", "ELEMENT", "PAIR")
)
"""SIZE, SQUARED: numbers of elements of A, and of P. ELEMENT, PAIR: from one of the covariance to the next."""
B, SAME, M, DIAGONAL, R, WHITE, SOLVED, Y, KEPT, VARIANCE, FINE, X, W, K, DOUBT, LOST, ENDED, E, SQUARE = list(
    _PLACES.values()
)[7:26]
EAST, NORTH, UP, WHOLE, VEAST, VNORTH, VUP, NEES, NEES_POSITION, OUTAGE = (_PLACES[name] for name in TOTALS[:10])
LARGEST, FARTHEST, NIS, UPDATES, NIS_USED, UPDATES_USED = (_PLACES[name] for name in TOTALS[10:])
DENSE = 1
"""Whether an adaptation of these runs sees whole matrices: they are shown to nobody else."""
AT = _TABLES["AT"]
"""(S, S) where the elements of P lie."""
EIGHTS = _TABLES["EIGHTS"]
"""(5, 8) where those of H P H' lie, row by row; the last four are any."""
