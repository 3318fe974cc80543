"""The chi-square test of an innovation. Everything here compiles with numba; scipy does not."""

import math

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import PluginError

FAR = 1400.0
"""Beyond it every tail for six rows is below 1e-290."""


def check_probability(name: str, probability: float) -> None:
    """Raise a PluginError where ``probability`` of adaptation ``name`` is none."""
    if not 0 < probability < 1:
        raise PluginError(f"{name}.probability is {probability}; it must lie between 0 and 1.")


def squared_distance(innovation: FloatArray, S: FloatArray) -> float:
    """Return y' S^-1 y."""
    return float(np.sum(innovation * np.linalg.solve(S, innovation)))


def chi2_tail(x: float, rows: int) -> float:
    """Return the probability that a chi-square variable with ``rows`` degrees of freedom exceeds ``x``.

    With Q_1 = erfc(sqrt(x/2)) and Q_2 = exp(-x/2), Q_(m+2) = Q_m + (x/2)^(m/2) exp(-x/2)/Gamma(m/2 + 1). So
    x > chi2(p, m) is the same as Q_m(x) < 1 - p, for any p and without a table.
    """
    half = 0.5 * min(x, FAR)
    odd = rows % 2
    tail = math.erfc(math.sqrt(half)) if odd else math.exp(-half)
    term = 2.0 * math.sqrt(half / math.pi) * math.exp(-half) if odd else half * math.exp(-half)
    for m in range(2 - odd, rows - 1, 2):
        tail += term
        term *= half / (0.5 * m + 1.0)
    return tail
