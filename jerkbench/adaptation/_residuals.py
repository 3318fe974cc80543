"""Residuals after an update, standardised, and R from weights on them. Everything here compiles with numba."""

import numpy as np

from jerkbench.arrays import FloatArray

SMALLEST_WEIGHT = 1e-9
"""No weight is taken below it, so that R stays finite; R may grow by its inverse."""


def standardised(innovation: FloatArray, HPHt: FloatArray, L: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return L^-1 y and L^-1 HPH' L^-T, R = L L': innovation and prior with R = I."""
    y = np.asarray(np.linalg.solve(L, innovation), dtype=np.float64)
    half = np.linalg.solve(L, HPHt)
    return y, np.asarray(np.linalg.solve(L, half.T), dtype=np.float64)


def residual_after(y: FloatArray, prior: FloatArray, weights: FloatArray) -> FloatArray:
    """Return D (prior + D)^-1 y, D = diag(1/weights): what is left of a standardised y after an update.

    D beside L D L': in the latter a row without weight leaves no digits to its neighbours.
    """
    inflation = 1.0 / np.maximum(weights, SMALLEST_WEIGHT)
    residual: FloatArray = inflation * np.linalg.solve(prior + np.diag(inflation), y)
    return residual


def reweighted(L: FloatArray, weights: FloatArray) -> FloatArray:
    """Return L diag(1/weights) L', symmetric to the bit, each weight not below the smallest."""
    R = (L / np.maximum(weights, SMALLEST_WEIGHT)) @ L.T
    return 0.5 * (R + R.T)


def gaussian_kernel(error: FloatArray, bandwidth: float) -> FloatArray:
    """Return exp(-e^2/(2 bandwidth^2))."""
    kernel: FloatArray = np.exp(-0.5 * (error / bandwidth) ** 2)
    return kernel
