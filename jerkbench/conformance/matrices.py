"""Checks of arrays: shape, finite, covariance."""

from typing import Any

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.conformance.require import require

TOLERANCE = 1e-8
"""Of symmetry and of eigenvalues, with the diagonal scaled to one."""


def require_shape(
    subject: str,
    array: Any,  # noqa: ANN401 - what a plugin returned
    shape: tuple[int, ...],
) -> None:
    """Raise an AssertionError unless ``array`` is a float64 array of ``shape``."""
    require(isinstance(array, np.ndarray), f"{subject} is a {type(array).__name__}; it must be a NumPy array.")
    require(array.dtype == np.float64, f"{subject} is of {array.dtype}; it must be float64.")
    require(array.shape == shape, f"{subject} has shape {array.shape}; it must be {shape}.")


def require_finite(subject: str, array: FloatArray) -> None:
    """Raise an AssertionError where ``array`` holds NaN or infinity."""
    require(np.isfinite(array).all(), f"{subject} holds NaN or infinity.")


def require_covariance(subject: str, matrix: FloatArray) -> None:
    """Raise an AssertionError unless ``matrix`` is finite, symmetric and positive semidefinite."""
    require_finite(subject, matrix)
    variances = np.diag(matrix)
    require((variances >= 0).all(), f"{subject} has a negative variance, {variances.min(initial=0.0):.3g}.")
    sigma = np.sqrt(np.where(variances > 0, variances, 1.0))
    scaled = matrix / np.outer(sigma, sigma)
    require(np.abs(scaled - scaled.T).max(initial=0.0) <= TOLERANCE, f"{subject} is not symmetric.")
    lowest = np.linalg.eigvalsh(scaled).min(initial=0.0)
    require(lowest >= -TOLERANCE * len(matrix), f"{subject} is not positive semidefinite (eigenvalue {lowest:.3g}).")
