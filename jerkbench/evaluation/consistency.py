"""Consistency: are the errors as large as the filter's own covariances say?"""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.estimate import Estimate, Updates
from jerkbench.evaluation.navigation_errors import known, position_error_m, velocity_error_mps
from jerkbench.plugins import register
from jerkbench.recording import Recording


@register("metric", "consistency")
@dataclass(frozen=True)
class Consistency:
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

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the four values by column name."""
        position = position_error_m(estimate, recording)
        error = np.hstack([position, velocity_error_mps(estimate, recording)])
        reference = recording.reference
        located = counted & known(reference.enu_m, estimate)
        both = located & known(reference.velocity_mps, estimate)
        start_s = np.min(reference.t_s[estimate.index][counted], initial=np.inf)
        late = estimate.updates.t_s >= start_s
        return {
            "anees": _anees(error[both], estimate.covariance[both]),
            "anees_position": _anees(position[located], estimate.covariance[located, :3, :3]),
            "anis_per_row": _anis(estimate.updates.nis[late], estimate.updates.rows[late]),
            "anis_used_per_row": _anis_used(estimate.updates, late),
        }


def _anees(error: FloatArray, covariance: FloatArray) -> float:
    """Return the mean of e' P^-1 e, by whitening with the Cholesky factor of P."""
    if len(error) == 0:
        return float("nan")
    try:
        white = np.linalg.solve(np.linalg.cholesky(covariance), error[:, :, None])
    except np.linalg.LinAlgError:
        return float("nan")
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.mean(np.sum(white[:, :, 0] ** 2, axis=1)))


def _anis(nis: FloatArray, rows: FloatArray) -> float:
    there = rows > 0
    return float(np.mean(nis[there] / rows[there])) if there.any() else float("nan")


def _anis_used(updates: Updates, late: BoolArray) -> float:
    """Return the mean over the updates that kept at least one row."""
    kept = updates.rows[late] - np.isinf(updates.R_diagonal[late]).sum(axis=1)
    return _anis(updates.nis_used[late], kept)
