"""Residuals after an update with weighed rows, in standard deviations of the measurement.

Everything here compiles with numba. With R = L L' (Cholesky) the innovation and the prior are L^-1 y and L^-1 HPH' L^-T
in standardised rows, in which R is the identity, and what is left of y after an update with L D L' is
D (L^-1 HPH' L^-T + D)^-1 L^-1 y, D = diag(1/weights). D stands beside the prior, not L D L': in that a row without
weight leaves no digits to its neighbours.
"""

import math
from typing import NamedTuple

import numpy as np

from jerkbench.adaptation._small import factorise, root_of, solve, weighed, whiten, whitened
from jerkbench.arrays import FloatArray

SMALLEST_WEIGHT = 1e-9
"""No weight is taken below it, so that R stays finite; R may grow by its inverse."""


class Residuals(NamedTuple):
    """An update of m rows.

    Attributes:
        U: (m, m) L'.
        prior: (m, m) L^-1 HPH' L^-T.
        y: (m,) L^-1 y.
        weights: (m,) not below `SMALLEST_WEIGHT`.
        e: (m,) the residual after the update with them.
        S: (m, m) prior + D.
        M: (m, m) factors of S.
    """

    U: FloatArray
    prior: FloatArray
    y: FloatArray
    weights: FloatArray
    e: FloatArray
    S: FloatArray
    M: FloatArray


def residuals_of(innovation: FloatArray, HPHt: FloatArray, R: FloatArray) -> Residuals:
    """Return the update before the first pass, with weights of 1."""
    m = len(innovation)
    U, vectors = root_of(R, m), np.ones((3, m))
    prior = whitened(U, HPHt)
    whiten(U, innovation, vectors[0])
    return Residuals(U, prior, vectors[0], vectors[1], vectors[2], prior.copy(), np.empty((m, m)))


def update(of: Residuals) -> None:
    """Fill e with the weights as they are."""
    for i in range(len(of.e)):
        of.S[i, i] = of.prior[i, i] + 1.0 / of.weights[i]
    factorise(of.S, of.M)
    solve(of.M, of.y, of.e)
    for i in range(len(of.e)):
        of.e[i] /= of.weights[i]


def adapted_covariance(of: Residuals) -> FloatArray:
    """Return L D L', symmetric to the bit."""
    return weighed(of.U, of.weights)


def gaussian_kernel(error: float, bandwidth: float) -> float:
    """Return exp(-e^2/(2 bandwidth^2))."""
    return math.exp(-0.5 * (error / bandwidth) ** 2)
