"""The strength and the factor of the relation between two series."""

import numpy as np

from jerkbench.arrays import FloatArray

SURE = 5.0
"""So many standard deviations from none is a relation, among the many that are tried."""


def strength(correlation: float, rows: int) -> float:
    """Return how many standard deviations from zero a correlation is: Fisher's atanh(r) sqrt(n - 3)."""
    return float(np.arctanh(np.clip(correlation, -0.9999, 0.9999)) * np.sqrt(max(rows - 3, 0)))


def slope(of: FloatArray, on: FloatArray) -> float:
    """Return the factor b of the least squares ``of`` = b ``on`` + a constant on each axis; 0 without any change."""
    of, on = of - of.mean(axis=0), on - on.mean(axis=0)
    size = float(np.sum(on**2))
    return float(np.sum(of * on)) / size if size > 0 else 0.0
