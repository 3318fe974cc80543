"""Where each part lies in the array w of several runs; a compilation replaces the sizes by those of the filter at hand.

The first parts are those of `jerkbench.engines.compiled.sizes`, so that the kernels of a single run fit. The covariance
between updates lies by pairs of axes, w[B + N N p + N a + b] for the p-th of (0, 0), (0, 1), (0, 2), (1, 1), (1, 2),
(2, 2): F = A (x) I3 then is the same product for each pair, and half of the covariance is enough.
"""

import itertools

from jerkbench.engines.compiled.sizes import sizes

ROWS = ("counted", "whole", "moving", "both")
"""What a row of the reference counts for; the weights of a row stand in this order."""

TOTALS = (
    *("EAST", "NORTH", "UP", "WHOLE", "VEAST", "VNORTH", "VUP", "NEES", "NEES_POSITION", "OUTAGE"),
    *("LARGEST", "FARTHEST", "NIS", "UPDATES", "NIS_USED", "UPDATES_USED", "ODD"),
)
"""What is summed up over a run; LARGEST and FARTHEST are maxima of squares, ODD is above 0 where a run needs care."""


def places(n: int) -> dict[str, int]:
    """Return the sizes and offsets for a filter with ``n`` quantities on each axis."""
    shared = sizes(n)
    lengths = {"V": 6 * shared["S"], "DIAGONAL": 6, "E": 6, "C": 36, "SQUARE": 1, **dict.fromkeys(TOTALS, 1), "ALL": 0}
    starts = itertools.accumulate(lengths.values(), initial=shared["LENGTH"])
    return {**shared, **dict(zip(lengths, starts, strict=False))}


EAST, NORTH, UP, WHOLE, VEAST, VNORTH, VUP, NEES, NEES_POSITION, OUTAGE = (places(3)[name] for name in TOTALS[:10])
LARGEST, FARTHEST, NIS, UPDATES, NIS_USED, UPDATES_USED, ODD = (places(3)[name] for name in TOTALS[10:])
V, DIAGONAL, E, C, SQUARE, ALL = (places(3)[name] for name in ("V", "DIAGONAL", "E", "C", "SQUARE", "ALL"))
