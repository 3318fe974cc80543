"""Functions that replace branches in methods of plugins that are compiled for a batch of eight runs.

In a class with ``lanes = True``, the arguments of a method are vectors with one number for each run
(`jerkbench.compilation.vectors`). A method with vector arguments must not branch on data. The four functions of this
module replace branches. For a single run, these functions have the same results as a branch.

An integer parameter is equal in all runs of a call, so a method may use the parameter as the number of iterations of a
loop. An integer parameter whose name is in ``varying`` is a vector instead. A method may also use ``+ - * /``, abs,
min, max, math.sqrt and math.exp. A method may create arrays with the type of its arguments: ``np.empty(shape,
P.dtype)``.
"""

from collections.abc import Callable
from typing import Any

import numpy as np


def select(left: float, right: float, yes: float, no: float) -> float:
    """Return ``yes`` if left > right, otherwise ``no``. If left or right is NaN, the result is ``no``."""
    return yes if left > right else no


chosen = select  # alias, because version 0.3 used this name


def each_run(function: Callable[..., float], *given: Any) -> float:  # noqa: ANN401 - any arguments
    """Return the result of ``function``, which is called separately for each run with the arguments ``given``.

    The function may branch on data. In each call, the function receives the numbers of one run. If an
    argument is an array, such as the memory of the adaptation, the function receives only the elements of this run. The
    last argument must be a number that can differ between runs, such as an innovation, and not a size or a row index.
    The function is also called for runs that do not take part in the update.
    """
    return function(*given)


def anywhere(flag: float) -> bool:
    """Return whether ``flag`` is above zero in at least one run."""
    return flag > 0.0


def above(pivot: float, least: float) -> float:
    """Return ``pivot`` if it is above ``least``. In a batch, the result is NaN for each run with a smaller ``pivot``.

    Raises:
        LinAlgError: ``pivot`` is not above ``least``, and the function is called for a single run.
    """
    if not pivot > least:
        raise np.linalg.LinAlgError("Matrix is not positive definite")
    return pivot


def above_in_lanes(pivot: float, least: float) -> float:
    """Return ``pivot`` for each run of a batch, or NaN for runs in which ``pivot`` is not above ``least``."""
    return select(pivot, least, pivot, float("nan"))
