"""The posterior Cramér-Rao bound of a linear model: no filter that knows no more has smaller errors."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray


class Step(NamedTuple):
    """One step of a linear model with the true noises.

    Attributes:
        F: (n, n) transition from the step before.
        Q: (n, n) covariance of what drives the state.
        H: (m, n) of the measurement; no rows where there is none.
        R: (m, m) its true covariance.
    """

    F: FloatArray
    Q: FloatArray
    H: FloatArray
    R: FloatArray


def posterior_bounds(initial: FloatArray, steps: Iterable[Step]) -> FloatArray:
    """Return (k, n, n) the smallest covariances of the state's error after each step.

    Of the information J, P = J^-1, the recursion of Tichavský is for a linear Gaussian model that of Riccati::

        P- = F P F' + Q,   P = (P-^-1 + H' R^-1 H)^-1 = (I - K H) P- (I - K H)' + K R K'

    Of noises that are not Gaussian it bounds linear filters only: the second-order bound.

    Source: Tichavský, Muravchik and Nehorai, "Posterior Cramér-Rao bounds for discrete-time nonlinear filtering", IEEE
    Trans. Signal Processing 46 (1998).

    Args:
        initial: (n, n) covariance of the state before the first step.
        steps: the model, step by step.
    """
    P = initial
    bounds = []
    for F, Q, H, R in steps:
        P = _updated(F @ P @ F.T + Q, H, R)
        bounds.append(P)
    return np.array(bounds).reshape(-1, *initial.shape)


def _updated(P: FloatArray, H: FloatArray, R: FloatArray) -> FloatArray:
    if len(H) == 0:
        return P
    K = np.linalg.solve(H @ P @ H.T + R, H @ P).T
    rest = np.eye(len(P)) - K @ H
    updated: FloatArray = rest @ P @ rest.T + K @ R @ K.T
    return (updated + updated.T) / 2
