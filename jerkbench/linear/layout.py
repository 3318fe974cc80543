"""Places of one filter in its array; kernels of the inertial navigation's update find theirs here too.

A compilation replaces these places by those of the size at hand.
"""

import itertools
from functools import cache

from jerkbench.compilation.vectors import WIDE

LARGEST = 9
"""States of the largest filter that is compiled: three quantities on three axes."""

NUMBERS = {"X": LARGEST, "Y": 6, "U": 6, "R": 36, "HPHT": 36, "S": 36, "LENGTH": 0}


@cache
def places(states: int) -> dict[str, int]:
    """Return the sizes and places for a filter with so many states, which lie in the order of the rows."""
    row = -(-states // WIDE)
    square = row * max(states, WIDE)
    vectors = {"P": square, "SPARE": square, **dict.fromkeys("HWKV", 6 * row), "DX": row, "ZERO": 1, "FIRST": 0}
    at = dict(zip(vectors, itertools.accumulate(vectors.values(), initial=0), strict=False))
    numbers = dict(zip(NUMBERS, itertools.accumulate(NUMBERS.values(), initial=WIDE * at.pop("FIRST")), strict=False))
    numbered = {f"{name}_AT": WIDE * at[name] for name in ("P", "SPARE", "H", "W", "K", "DX")}
    sizes = {"STATES": states, "QUANTITIES": states // 3, "ROW": row, "STRIDE": WIDE * row}
    return {**sizes, **at, **numbered, **numbers}


_PLACES = places(LARGEST)
STATES, QUANTITIES, ROW, STRIDE = (_PLACES[name] for name in ("STATES", "QUANTITIES", "ROW", "STRIDE"))
P, SPARE = _PLACES["P"], _PLACES["SPARE"]
P_AT, SPARE_AT, H_AT, DX_AT = (_PLACES[name] for name in ("P_AT", "SPARE_AT", "H_AT", "DX_AT"))
X, Y, R, HPHT, S = (_PLACES[name] for name in ("X", "Y", "R", "HPHT", "S"))
