"""Residuals after an update, standardised, and R from weights on them. Everything here compiles with numba."""

import numpy as np

from jerkbench.arrays import FloatArray

SMALLEST_WEIGHT = 1e-9
"""No weight is taken below it, so that R stays finite; R may grow by its inverse."""


def standardised_residual(innovation: FloatArray, HPHt: FloatArray, R: FloatArray, L: FloatArray) -> FloatArray:
    """Return L^-1 (z - H x+), with x+ the state after an update with ``R``: z - H x+ = R S^-1 y."""
    residual = np.sum(R * np.linalg.solve(HPHt + R, innovation), axis=1)  # R times the vector
    standardised: FloatArray = np.linalg.solve(L, residual)
    return standardised


def reweighted(L: FloatArray, weights: FloatArray) -> FloatArray:
    """Return L diag(1/weights) L', symmetric to the bit, each weight not below the smallest."""
    R = (L / np.maximum(weights, SMALLEST_WEIGHT)) @ L.T
    return 0.5 * (R + R.T)


def gaussian_kernel(error: FloatArray, bandwidth: float) -> FloatArray:
    """Return exp(-e^2/(2 bandwidth^2))."""
    kernel: FloatArray = np.exp(-0.5 * (error / bandwidth) ** 2)
    return kernel
