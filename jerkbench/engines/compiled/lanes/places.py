"""Where each part lies in the array w of several runs: all that a run needs, and the sums of its errors.

A compilation replaces these places by those of the filter at hand.
"""

import itertools
from functools import cache

import numpy as np

from jerkbench.arrays import IntArray
from jerkbench.engines.compiled import places as of_a_run

ROWS = ("counted", "whole", "moving", "both")
"""What a row of the reference counts for; the weights of a row stand in this order."""

TOTALS = (
    *("EAST", "NORTH", "UP", "WHOLE", "VEAST", "VNORTH", "VUP", "NEES", "NEES_POSITION", "OUTAGE"),
    *("LARGEST", "FARTHEST", "NIS", "UPDATES", "NIS_USED", "UPDATES_USED"),
)
"""What is summed up over a run; LARGEST and FARTHEST are maxima of squares."""


@cache
def places(n: int) -> dict[str, int]:
    """Return the sizes and places for a filter with ``n`` quantities on each axis."""
    shared = of_a_run.places(n)
    lengths = {"E": 6, "SQUARE": 1, "VARIANCE": 8, **dict.fromkeys(TOTALS, 1), "ALL": 0}
    starts = itertools.accumulate(lengths.values(), initial=shared["LENGTH"])
    return {**shared, "SIZE": n * n, "SQUARED": 9 * n * n, **dict(zip(lengths, starts, strict=False))}


def tables(n: int) -> dict[str, IntArray]:
    """Return where elements of the covariance lie, for the same filter."""
    at = of_a_run.square(n)
    return {"AT": at, "HP_AT": at[:6].copy(), "PRIOR_AT": at[:6, :6].copy(), "HPHT_AT": _by_eights(at[:6, :6])}


def _by_eights(at: IntArray) -> IntArray:
    """(5, 8) the 36 places row by row; the last four are any."""
    return np.resize(at, (5, 8))


EAST, NORTH, UP, WHOLE, VEAST, VNORTH, VUP, NEES, NEES_POSITION, OUTAGE = (places(3)[name] for name in TOTALS[:10])
LARGEST, FARTHEST, NIS, UPDATES, NIS_USED, UPDATES_USED = (places(3)[name] for name in TOTALS[10:])
E, SQUARE, VARIANCE, ALL = (places(3)[name] for name in ("E", "SQUARE", "VARIANCE", "ALL"))
SIZE, SQUARED = places(3)["SIZE"], places(3)["SQUARED"]
"""Numbers of elements of A, and of P."""
HPHT_AT = tables(3)["HPHT_AT"]
"""(5, 8) where the elements of H P H' lie, row by row."""
