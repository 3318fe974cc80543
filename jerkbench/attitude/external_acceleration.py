"""The variance of an external acceleration, four ways: none, mtf, scalar, lee.

Each gives the diagonal of Sigma_acc, which is added to sigma_A^2 I. The
trigger test e'e >= tr(C0) is taken before, with Sigma_acc = 0.
"""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray

ADAPTATIONS = ("none", "mtf", "scalar", "lee")


class Evidence(NamedTuple):
    """What one accelerometer sample tells of an external acceleration.

    Attributes:
        innovation: (3,) e = z - g x- [m/s2].
        mean_squares: (3,) w, the mean of e_i^2 over the window [m2/s4].
        C0_diagonal: (3,) diagonal of C0 = g^2 P- + sigma_A^2 I [m2/s4].
        triggered: e'e >= tr(C0).
        predicted: (3,) c_a a_prev, the external acceleration expected from the sample before [m/s2].
    """

    innovation: FloatArray
    mean_squares: FloatArray
    C0_diagonal: FloatArray
    triggered: bool
    predicted: FloatArray


def none_variance(_evidence: Evidence) -> FloatArray:
    """Sigma_acc = 0."""
    return np.zeros(3)


def mtf_variance(evidence: Evidence) -> FloatArray:
    """Multiple tuning factors: diag(max(0, w_i - C0_ii)) if triggered, else 0; [m2/s4]."""
    if not evidence.triggered:
        return np.zeros(3)
    return np.maximum(evidence.mean_squares - evidence.C0_diagonal, 0.0)


def scalar_variance(evidence: Evidence) -> FloatArray:
    """Scale all axes alike: I (e'e - tr C0)/3 if triggered, else 0; [m2/s4]."""
    if not evidence.triggered:
        return np.zeros(3)
    e = evidence.innovation
    return np.full(3, (e @ e - evidence.C0_diagonal.sum()) / 3)


def lee_variance(evidence: Evidence) -> FloatArray:
    """External-acceleration model of Lee et al. (2012): I |c_a a_prev|^2/3, always; [m2/s4]."""
    return np.full(3, evidence.predicted @ evidence.predicted / 3)


def acceleration_variance(adapt: str, evidence: Evidence) -> FloatArray:
    """Return the diagonal (3,) of Sigma_acc [m2/s4] by the rule ``adapt``, one of `ADAPTATIONS`."""
    if adapt == "mtf":
        return mtf_variance(evidence)
    if adapt == "scalar":
        return scalar_variance(evidence)
    if adapt == "lee":
        return lee_variance(evidence)
    return none_variance(evidence)
