"""Variational Bayes on the diagonal of R."""

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from jerkbench.adaptation._ranges import FORGETTING, check_passes
from jerkbench.arrays import FloatArray, IntArray
from jerkbench.errors import PluginError
from jerkbench.parameters import DefaultOrigin, Provenance, Range
from jerkbench.plugins import register


@register("adaptation", "variational_bayes")
@dataclass(frozen=True)
class VariationalBayes:
    """Estimates each variance of R by variational Bayes, as an inverse gamma that is forgotten slowly.

    For each row, alpha = a0 and beta = a0 r_i before its first update, r_i as reported. At each update, with y the
    innovation and HPH' = H P- H'::

        alpha = rho alpha + 1/2,  beta- = rho beta,  beta = beta-
        twice:  R = diag(beta / alpha),  S = HPH' + R,  res = R S^-1 y
                beta = beta- + (res_i^2 + (R - R S^-1 R)_ii) / 2

    R - R S^-1 R is the paper's HPH' - HPH' S^-1 HPH', without its rounding where R is the smaller (after a gap).
    The filter uses the R of the last pass. The reported R enters at the start only: a receiver that knows how good it
    is at each moment is not listened to any more. 1/(1 - rho) is the memory in updates, 55 with the default: good on
    noise that is reported wrongly or changes slowly, late on bursts, misled by a wrong process.

    Source: S. Sarkka, A. Nummenmaa, "Recursive noise adaptive Kalman filtering by variational Bayesian approximations",
    IEEE Trans. Automatic Control 54(3), 596-600, 2009, doi:10.1109/TAC.2008.2008348.

    Attributes:
        forgetting: rho, share of the old knowledge that an update keeps [-].
        start: a0, alpha at the start: the weight of the reported variance, in half updates [-].
        passes: fixed-point passes of an update [-].
    """

    provenance = Provenance("published", "doi:10.1109/TAC.2008.2008348")

    forgetting: Annotated[float, FORGETTING, DefaultOrigin("literature: rho of the source")] = 1.0 - math.exp(-4.0)
    start: Annotated[
        float,
        Range(0.5, 50.0, log=True, source="ours: the reported R counts from one update to 100"),
        DefaultOrigin("ours: the reported R counts six half updates"),
    ] = 3.0
    passes: Annotated[int, DefaultOrigin("literature: the source finds two enough")] = 2

    def __post_init__(self) -> None:
        """Check the ranges."""
        if not 0 < self.forgetting < 1:
            raise PluginError(f"variational_bayes.forgetting is {self.forgetting}; it must lie between 0 and 1.")
        if not self.start > 0:
            raise PluginError(f"variational_bayes.start is {self.start}; it must be above 0.")
        check_passes("variational_bayes", self.passes)

    def memory_size(self) -> int:
        """Return 12: alpha and beta of each row."""
        return 12

    def adapt(
        self, innovation: FloatArray, HPHt: FloatArray, R: FloatArray, rows: IntArray, memory: FloatArray
    ) -> FloatArray:
        """Return the diagonal R of the estimated variances."""
        begun = memory[rows] > 0.0
        alpha = self.forgetting * np.where(begun, memory[rows], self.start) + 0.5
        kept = self.forgetting * np.where(begun, memory[rows + 6], self.start * np.diag(R))
        beta = kept
        r = beta / alpha
        for _ in range(self.passes):
            r = beta / alpha
            S = HPHt + np.diag(r)
            residual = r * np.linalg.solve(S, innovation)
            posterior = r - r * np.diag(np.linalg.solve(S, np.diag(r)))
            beta = kept + 0.5 * (residual**2 + posterior)
        memory[rows], memory[rows + 6] = alpha, beta
        return np.diag(r)
