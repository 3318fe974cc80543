"""Consistency of the errors with the filter's own covariances."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray
from jerkbench.estimate import Estimate
from jerkbench.evaluation.navigation_errors import known, mean, position_error_m
from jerkbench.evaluation.sums import Summed
from jerkbench.plugins import register
from jerkbench.recording import Recording
from jerkbench.sums import Sums


@register("metric", "consistency")
@dataclass(frozen=True)
class Consistency(Summed):
    """Average NEES and NIS: more than expected is overconfident, less is too cautious.

    With e_i the errors of position and velocity and P_i their covariance, over the N counted rows whose reference is
    known, and with the M updates from the first counted row on, of m_u rows each::

        anees              = 1/N sum e_i' P_i^-1 e_i         position and velocity together, expect 6
        anees_position     = the same with position alone, expect 3
        anis_per_row       = 1/M sum nis_u / m_u             nis = y' (H P- H' + R)^-1 y, reported R, expect 1
        anis_used_per_row  = the same with the S that was used and the m_u rows that were not dropped, expect 1

    A filter that inflates R always looks consistent by the last one; judge it by ``anis_per_row``. NaN where there is
    no such row or update, or where a covariance is not positive definite.

    Source: Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation", 5.4.
    """

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the four values by column name."""
        return {
            "anees": mean(sums.nees, sums.nees_rows),
            "anees_position": mean(sums.nees_position, float(sums.position_rows[0])),
            "anis_per_row": mean(sums.nis_per_row, sums.nis_updates),
            "anis_used_per_row": mean(sums.nis_used_per_row, sums.nis_used_updates),
        }


# The share of position errors within the sigmas that the filter claims.

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


# Errors that the filter rules out: it is wrong and does not know.

RULED_OUT = 3.0
"""Sigmas, in three dimensions: a consistent filter is beyond them in 2.9 % of the rows."""


@register("metric", "silent_error")
@dataclass(frozen=True)
class SilentError(Summed):
    """Share and longest time of position errors beyond three sigmas of the filter's own covariance.

    With e_i the position error [m] and P_i its covariance [m2], over the N rows that are the first counted one of a
    second, row i is silent where sqrt(e_i' P_i^-1 e_i) > 3::

        silent_error_percent = 100/N |{i: silent}|          expect 2.9: chi-square with 3 degrees of freedom beyond 9
        silent_error_s       = the most silent rows in a row, one a second [s]

    A filter may be accurate on average and wild for a minute without saying so. NaN without a row, or where a
    covariance is not positive definite.
    """

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the two values by column name."""
        error, covariance = sums.sampled_m, sums.sampled_covariance_m2
        definite = np.isfinite(covariance).all(axis=(1, 2)) & np.isfinite(error).all(axis=1)
        if not len(error) or not definite.all() or not (np.linalg.eigvalsh(covariance)[:, 0] > 0).all():
            return {"silent_error_percent": np.nan, "silent_error_s": np.nan}
        white = np.linalg.solve(covariance, error[:, :, None])[:, :, 0]
        silent = (error * white).sum(axis=1) > RULED_OUT**2
        edges = np.flatnonzero(np.diff(np.concatenate([[0], silent.astype(np.int8), [0]])))
        longest = np.max(edges[1::2] - edges[::2], initial=0)
        return {"silent_error_percent": 100 * float(silent.mean()), "silent_error_s": float(longest)}
