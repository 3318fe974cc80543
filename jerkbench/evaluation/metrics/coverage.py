"""The share of position errors within the sigmas that the filter claims."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import known, position_error_m
from jerkbench.plugins import register
from jerkbench.recording import Recording

SIGMAS = (1, 2, 3)


@register("metric", "coverage")
@dataclass(frozen=True)
class Coverage:
    """Share of the position errors within one, two and three sigmas.

    With e_ia the error of axis a at counted row i and P_i the covariance, over the N rows and three axes::

        coverage_k_sigma_percent = 100/(3 N) |{i, a: |e_ia| <= k sqrt(P_i,aa)}|     expect 68.3, 95.4, 99.7

    NaN without a row. Not computed unless asked for: ``metrics=[coverage]``.
    """

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values by column name."""
        rows = counted & known(recording.reference.enu_m, estimate)
        error = np.abs(position_error_m(estimate, recording)[rows])
        with np.errstate(invalid="ignore"):
            sigma = np.sqrt(np.diagonal(estimate.covariance[rows], axis1=1, axis2=2)[:, :3])
            shares = {k: float(np.mean(error <= k * sigma)) if rows.any() else np.nan for k in SIGMAS}
        return {f"coverage_{k}_sigma_percent": 100 * share for k, share in shares.items()}
