"""Where each part of one run lies: rows of matrices in vectors, each row in ROW vectors; the rest number by number.

A compilation replaces these places by those of the filter at hand.
"""

import itertools
from functools import cache

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.compilation.vectors import WIDTH, aligned_zeros

AXES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
"""The pairs of axes whose covariances a vector holds; its last two numbers are zero."""

NUMBERED = {
    "X": "STATE",
    "PAIRS": "B",
    "COVARIANCE": "SQUARE",
    "HP": "W",
    "GAIN": "K",
    "LEFT": "V",
    "REST": "SPARE",
    "STEP": "MOVE",
}
"""Vectors that are also read number by number, at these names."""


@cache
def places(n: int) -> dict[str, int]:
    """Return the sizes and places for a filter with ``n`` quantities on each axis.

    In the square and in the gain the states that are not measured (FIRST in number) come before those that are: the
    update computes the lower triangle only, and there rounding of the prior is damped if the row is a measured one.
    """
    s, row = 3 * n, -(-3 * n // WIDTH)
    vectors = {
        "STATE": row,
        "MOVE": row,  # K y
        "SAME": 1,  # 1 for a pair of an axis with itself
        "B": n * n,  # covariance by pairs of axes
        "AB": n * n,  # A times it
        "SQUARE": s * row,  # covariance as a square
        "W": 6 * row,  # H P
        "K": 6 * row,  # the gain, transposed
        "V": 6 * row,  # (A H' - K R)'
        "SPARE": s * row,
        "NUMBERS": 0,
    }
    at = dict(zip(vectors, itertools.accumulate(vectors.values(), initial=0), strict=False))
    numbers = {
        "M": 36,
        "DIAGONAL": 6,
        "R": 36,
        "WHITE": 6,
        "Y": 6,
        "KEPT": 6,
        "ODD": 1,
        "INVERSE": 36,
        "SEEN_Y": 6,
        "SEEN_HPHT": 36,
        "SEEN_R": 36,
        "ADAPTED": 36,
        "LENGTH": 0,  # the adaptation's
    }
    alone = dict(zip(numbers, itertools.accumulate(numbers.values(), initial=WIDTH * at["NUMBERS"]), strict=False))
    numbered = {name: WIDTH * at[vector] for name, vector in NUMBERED.items()}
    measured = {"FIRST": s - 6, "P": at["SQUARE"] + row * (s - 6)}
    measured["PRIOR"] = WIDTH * measured["P"] + s - 6
    return {"N": n, "S": s, "SIZE": n * n, "ROW": row, "PRIOR_ROW": WIDTH * row, **at, **alone, **numbered, **measured}


def room(n: int) -> FloatArray:
    """Zeros for a run."""
    return aligned_zeros(places(n)["LENGTH"])


def tables(n: int) -> dict[str, IntArray]:
    """Return where elements of the covariance lie, for the same filter."""
    at, rows = places(n), np.arange(6)[:, None]
    return {
        "SQUARE_FROM_PAIRS": square_from_pairs(n),
        "PAIRS_FROM_SQUARE": pairs_from_square(n),
        "HP_AT": at["P"] + at["ROW"] * rows + np.arange(at["ROW"]),
        "PRIOR_AT": at["PRIOR"] + at["PRIOR_ROW"] * rows + np.arange(6),
    }


def square_from_pairs(n: int) -> IntArray:
    """(3n, 3n) where each element of the square lies among the pairs, counted from PAIRS."""
    order = _order(n)
    return np.array([[_in_pairs(n, row, column) for column in order] for row in order])


def eight_of_measured(first: int) -> tuple[int, ...]:
    """Return where numbers ``first`` to ``first`` + 7 of the (6, 6) covariance of position and velocity lie.

    Counted from the first of four vectors of pairs: position with position, position with velocity, velocity with
    position, velocity with velocity.
    """
    return tuple(_in_pairs(2, *divmod(first + k, 6)) for k in range(WIDTH))


def pairs_from_square(n: int) -> IntArray:
    """(n n, 6) where each element of the pairs lies in the lower triangle of the square, counted from COVARIANCE."""
    length, order = WIDTH * -(-3 * n // WIDTH), _order(n)

    def at(element: int, pair: int) -> int:
        """Return the place of one element."""
        (a, b), (i, j) = divmod(element, n), AXES[pair]
        row, column = sorted((order.index(3 * a + i), order.index(3 * b + j)), reverse=True)
        return length * row + column

    return np.array([[at(element, pair) for pair in range(6)] for element in range(n * n)])


def _order(n: int) -> list[int]:
    """The states in the order of the square."""
    return [*range(6, 3 * n), *range(6)]


def _in_pairs(n: int, row: int, column: int) -> int:
    (a, i), (b, j) = divmod(row, 3), divmod(column, 3)
    if i > j:
        (a, i), (b, j) = (b, j), (a, i)
    return WIDTH * (n * a + b) + AXES.index((i, j))


S, SIZE, FIRST, SAME, AB, SQUARE, SPARE, MOVE = (
    places(3)[name] for name in ("S", "SIZE", "FIRST", "SAME", "AB", "SQUARE", "SPARE", "MOVE")
)
P, PRIOR, PRIOR_ROW = (places(3)[name] for name in ("P", "PRIOR", "PRIOR_ROW"))
"""P: the measured rows of the square. PRIOR: H P H', number by number. PRIOR_ROW: length of a row of the square."""
PAIRS, COVARIANCE, HP, GAIN, LEFT, REST, STEP = (places(3)[name] for name in list(NUMBERED)[1:])
INVERSE, LENGTH = places(3)["INVERSE"], places(3)["LENGTH"]
SEEN_Y, SEEN_HPHT, SEEN_R, ADAPTED = (places(3)[name] for name in ("SEEN_Y", "SEEN_HPHT", "SEEN_R", "ADAPTED"))
SQUARE_FROM_PAIRS, PAIRS_FROM_SQUARE = square_from_pairs(3), pairs_from_square(3)
FIRST_EIGHT, SECOND_EIGHT, THIRD_EIGHT, FOURTH_EIGHT, LAST_EIGHT = map(eight_of_measured, (0, 8, 16, 24, 28))
