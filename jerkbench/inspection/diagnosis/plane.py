"""The ways in which two horizontal axes may have been exchanged, turned by right angles or mirrored."""

import numpy as np

from jerkbench.arrays import FloatArray

IDENTITY = "as they are"
MIRRORED_Y = "second axis the other way"
EXCHANGED = "axes exchanged"

PLANE = {
    IDENTITY: ((1, 0), (0, 1)),
    "turned by 90 degrees": ((0, -1), (1, 0)),
    "turned by 180 degrees": ((-1, 0), (0, -1)),
    "turned by -90 degrees": ((0, 1), (-1, 0)),
    "first axis the other way": ((-1, 0), (0, 1)),
    MIRRORED_Y: ((1, 0), (0, -1)),
    EXCHANGED: ((0, 1), (1, 0)),
    "axes exchanged, both the other way": ((0, -1), (-1, 0)),
}
"""What mends each: (right axes) = P (given axes)."""


def mended(values: FloatArray, way: str) -> FloatArray:
    """Return values (n, 2) with the axes mended."""
    return np.asarray(values @ np.array(PLANE[way], dtype=np.float64).T, dtype=np.float64)


def axes_text(way: str, names: tuple[str, str]) -> tuple[str, str]:
    """Return which of the axes given, called ``names``, is to become the first, and which the second: "-y", "x"."""
    rows = PLANE[way]
    first, second = (("-" if sum(row) < 0 else "") + names[0 if row[0] else 1] for row in rows)
    return first, second
