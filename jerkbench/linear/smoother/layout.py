"""The parts of a row of the tape."""

from functools import cache

from jerkbench.compilation.vectors import WIDE
from jerkbench.compilation.views import Run
from jerkbench.kinematic.layout import with_covariance

SEGMENT = 32
"""Most steps from one row of the tape to the next."""


@cache
def tape_type(n: int, width: int) -> Run:
    """Return the type of a row, for ``width`` runs of a filter with ``n`` quantities on each axis."""
    s = 3 * n
    shapes = {
        "x": (s,),  # filtered state
        "left": (6, s),  # the first six columns of I - K H, one after the other
        "inverse": (6, 6),  # of S, its lower half
        "weighed": (6,),  # S^-1 y
    }
    return with_covariance(shapes, n, width)


ROW = tape_type(3, WIDE)
"""The type at hand: a compilation replaces it."""
