"""Where each part lies in the array w of several runs: all that a run needs, and the sums of its errors.

A compilation replaces these places by those of the filter at hand.
"""

import itertools

from jerkbench.engines.compiled import places as of_a_run

ROWS = ("counted", "whole", "moving", "both")
"""What a row of the reference counts for; the weights of a row stand in this order."""

TOTALS = (
    *("EAST", "NORTH", "UP", "WHOLE", "VEAST", "VNORTH", "VUP", "NEES", "NEES_POSITION", "OUTAGE"),
    *("LARGEST", "FARTHEST", "NIS", "UPDATES", "NIS_USED", "UPDATES_USED"),
)
"""What is summed up over a run; LARGEST and FARTHEST are maxima of squares."""


def places(n: int) -> dict[str, int]:
    """Return the sizes and places for a filter with ``n`` quantities on each axis."""
    shared = of_a_run.places(n)
    lengths = {"E": 6, "C": 36, "SQUARE": 1, **dict.fromkeys(TOTALS, 1), "ALL": 0}
    starts = itertools.accumulate(lengths.values(), initial=shared["LENGTH"])
    return {**shared, **dict(zip(lengths, starts, strict=False))}


EAST, NORTH, UP, WHOLE, VEAST, VNORTH, VUP, NEES, NEES_POSITION, OUTAGE = (places(3)[name] for name in TOTALS[:10])
LARGEST, FARTHEST, NIS, UPDATES, NIS_USED, UPDATES_USED = (places(3)[name] for name in TOTALS[10:])
E, C, SQUARE, ALL = (places(3)[name] for name in ("E", "C", "SQUARE", "ALL"))
