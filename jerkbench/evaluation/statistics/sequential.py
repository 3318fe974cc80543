"""Seeds added in blocks until everything is decided: the level that each look at the results may spend."""

import numpy as np

from jerkbench.arrays import FloatArray

FIRST = 20
"""Seeds before the first look: fewer decide little, as the bootstrap of many comparisons is wide."""


def looks(most: int, first: int = FIRST) -> list[int]:
    """Return the numbers of seeds at which one looks: ``first``, twice as many each time, ``most`` at the end.

    >>> looks(400)
    [20, 40, 80, 160, 320, 400]
    """
    sizes = []
    size = first
    while size < most:
        sizes.append(size)
        size *= 2
    return [*sizes, most]


def levels(sizes: list[int], level: float = 0.05) -> FloatArray:
    """Return the level (k,) of each look at ``sizes`` seeds; together they spend ``level`` and no more.

    With t the share of the seeds of the last look, alpha(t) = level log(1 + (e - 1) t) is spent by each look; its own
    level is what the look adds. The sum, not the joint distribution of the looks, holds the level: that is valid for
    the largest of many comparisons as well, of which different ones may be the largest at different looks.

    Source: Lan and DeMets, "Discrete sequential boundaries for clinical trials", Biometrika 70 (1983), Pocock's type.
    """
    t = np.asarray(sizes, dtype=np.float64) / sizes[-1]
    spent = level * np.log1p((np.e - 1) * t)
    return np.diff(spent, prepend=0.0)
