"""Places in a row of the tape; a compilation replaces them by those of the filter at hand.

A row begins with the covariance, in the order of the kernel, and the state.
"""

import itertools
from functools import cache

from jerkbench.compilation.vectors import WIDE
from jerkbench.kinematic.layout import AXES

SEGMENT = 32
"""Most steps from one row of the tape to the next."""


@cache
def places(n: int, width: int) -> dict[str, int]:
    """Return the sizes and places for ``width`` runs of a filter with ``n`` quantities on each axis."""
    lengths = {
        "COVARIANCE": n * n * (WIDE if width == 1 else len(AXES)),
        "STATE": 3 * n,
        "LEFT": 6 * 3 * n,  # the first six columns of I - K H, one after the other
        "INVERSE": 21,  # of S, its lower half row by row
        "WEIGHED": 6,  # S^-1 y
        "ROW": 0,
    }
    at = dict(zip(lengths, itertools.accumulate(lengths.values(), initial=0), strict=False))
    whole = -(-at["ROW"] // WIDE) * WIDE
    filtered = -(-at["LEFT"] // WIDE) * WIDE
    return {**at, "ROW": whole, "FILTERED": filtered, "COVARIANCE_LENGTH": lengths["COVARIANCE"]}


_PLACES = places(3, 1)
STATE, LEFT, INVERSE, WEIGHED, ROW, FILTERED, COVARIANCE_LENGTH = (
    _PLACES[name] for name in ("STATE", "LEFT", "INVERSE", "WEIGHED", "ROW", "FILTERED", "COVARIANCE_LENGTH")
)
