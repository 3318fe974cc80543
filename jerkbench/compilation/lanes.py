"""Choices that a method of a plugin makes for one run; compiled for several side by side it makes one in each.

A method that says ``lanes = True`` may not branch on data: what it is given are vectors then, one number of each run
(`jerkbench.compilation.vectors`). These four stand for the branches that it needs; by name they are replaced. A whole
number among its parameters is the same in all runs that are asked at once, and may say how often a loop goes round; one
that `varying` names is a vector like the others.
Besides them it may use ``+ - * /``, abs, min, max, math.sqrt and math.exp, and make arrays of the type of those that it
is given: ``np.empty(shape, P.dtype)``.
"""

from collections.abc import Callable
from typing import Any

import numpy as np


def chosen(left: float, right: float, yes: float, no: float) -> float:
    """Return ``yes`` where left > right, else ``no`` (also where one of them is NaN)."""
    return yes if left > right else no


def each_run(function: Callable[..., float], *given: Any) -> float:  # noqa: ANN401 - what the function takes
    """Return ``function(*given)``, a number, which may branch: it is asked for each run by itself.

    It gets the numbers of one run, and of an array (its memory) those that are of this run. The last that is given must
    be a number of the run (innovation, memory), no size or row. Runs that do not ask, or are lost, are asked about too.
    """
    return function(*given)


def anywhere(flag: float) -> bool:
    """Return whether a number is above zero in any of the runs."""
    return flag > 0.0


def above(pivot: float, least: float) -> float:
    """Return ``pivot``, which must lie above ``least``; side by side it is NaN in the runs where it does not.

    Raises:
        LinAlgError: it does not, in a run by itself.
    """
    if not pivot > least:
        raise np.linalg.LinAlgError("Matrix is not positive definite")
    return pivot


def above_in_lanes(pivot: float, least: float) -> float:
    """The same side by side: NaN in the runs where it does not."""
    return chosen(pivot, least, pivot, float("nan"))
