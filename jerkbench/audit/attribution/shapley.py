"""Shapley's shares of a gain: what each factor adds, mean over all orders in which they can be added."""

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations
from math import factorial

import numpy as np

from jerkbench.arrays import FloatArray

Corner = frozenset[str]
"""The factors that are on."""


def corners(factors: Sequence[str]) -> Iterator[Corner]:
    """Yield every subset of the factors, the empty one first and the whole last."""
    for size in range(len(factors) + 1):
        yield from map(frozenset, combinations(factors, size))


def shapley(values: Mapping[Corner, FloatArray], factors: Sequence[str]) -> dict[str, FloatArray]:
    """Return the share of each factor; they add up to the value of the whole less that of the empty corner.

    With v(S) the value where the factors S are on, of n factors::

        phi_i = sum over S without i of |S|! (n - |S| - 1)! / n! (v(S + i) - v(S))

    Args:
        values: of every corner, of any shape: a share of each element is taken by itself.
        factors: their names.

    Source: L. S. Shapley, "A value for n-person games", Contributions to the Theory of Games II, Princeton (1953).
    """
    return {factor: _share(values, factor, [f for f in factors if f != factor]) for factor in factors}


def _share(values: Mapping[Corner, FloatArray], factor: str, rest: Sequence[str]) -> FloatArray:
    n = len(rest) + 1
    parts = [
        factorial(len(corner)) * factorial(n - len(corner) - 1) / factorial(n) * step(values, corner, factor)
        for corner in corners(rest)
    ]
    return np.asarray(np.sum(parts, axis=0))


def step(values: Mapping[Corner, FloatArray], corner: Corner, factor: str) -> FloatArray:
    """Return what a factor adds at a corner where it is off."""
    return np.asarray(values[corner | {factor}] - values[corner])
