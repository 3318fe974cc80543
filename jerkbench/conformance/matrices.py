"""Checks of arrays: shape, finite, covariance."""

from typing import Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.conformance.require import require

TOLERANCE = 1e-8
"""Of symmetry and of eigenvalues, with the diagonal scaled to one."""


def require_shape(
    what: str,
    array: Any,  # noqa: ANN401 - what a plugin returned
    shape: tuple[int, ...],
) -> None:
    """Raise an AssertionError unless ``array`` is a float64 array of ``shape``."""
    require(isinstance(array, np.ndarray), f"{what} is a {type(array).__name__}; it must be a NumPy array.")
    require(array.dtype == np.float64, f"{what} is of {array.dtype}; it must be float64.")
    require(array.shape == shape, f"{what} has shape {array.shape}; it must be {shape}.")


def require_finite(what: str, array: FloatArray) -> None:
    """Raise an AssertionError where ``array`` holds NaN or infinity."""
    require(np.isfinite(array).all(), f"{what} holds NaN or infinity.")


def require_covariance(what: str, matrix: FloatArray) -> None:
    """Raise an AssertionError unless ``matrix`` is finite, symmetric and positive semidefinite."""
    require_finite(what, matrix)
    variances = np.diag(matrix)
    require((variances >= 0).all(), f"{what} has a negative variance, {variances.min(initial=0.0):.3g}.")
    sigma = np.sqrt(np.where(variances > 0, variances, 1.0))
    scaled = matrix / np.outer(sigma, sigma)
    require(np.abs(scaled - scaled.T).max(initial=0.0) <= TOLERANCE, f"{what} is not symmetric.")
    lowest = np.linalg.eigvalsh(scaled).min(initial=0.0)
    require(lowest >= -TOLERANCE * len(matrix), f"{what} is not positive semidefinite (eigenvalue {lowest:.3g}).")
