"""Metrics of consistency: errors and innovations against the covariances of the filter, and proper scores."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, streaks
from jerkbench.estimate import Estimate, Sums
from jerkbench.evaluation.correlated_errors import whiteness_of_rows
from jerkbench.evaluation.counted_rows import counted_errors, first_counted_s, mean
from jerkbench.evaluation.evaluated_run import Summed
from jerkbench.parameters import Column
from jerkbench.plugins import register
from jerkbench.recording import Recording

EXPECTED_ANEES = 6.0
"""Expected ANEES of position and velocity: the number of these states."""


@register("metric", "consistency")
@dataclass(frozen=True)
class Consistency(Summed):
    """Average NEES and NIS. Above the expected value a filter is overconfident, below it too cautious.

    Let e_i be the errors of position and velocity, and P_i the covariance of the filter, at the N counted rows whose
    reference is known. From the first counted row on, there are M updates, and update u measures m_u rows::

        anees              = 1/N sum e_i' P_i^-1 e_i         position and velocity together, expect 6
        anees_position     = the same with position alone, expect 3
        anis_per_row       = 1/M sum nis_u / m_u             nis = y' (H P- H' + R)^-1 y, reported R, expect 1
        anis_used_per_row  = the same with the used S and the m_u rows that were not dropped, expect 1

    A filter that inflates R can make ``anis_used_per_row`` consistent for any innovations, and should therefore be
    judged by ``anis_per_row``. A value is NaN if no row or no update is counted, or if a covariance is not positive
    definite.

    Source: Bar-Shalom, Li and Kirubarajan, "Estimation with Applications to Tracking and Navigation", 5.4.
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "anees": Column("ANEES of position and velocity", expected=EXPECTED_ANEES, section=16),
        "anees_position": Column("ANEES of position", expected=3),
        "anis_per_row": Column("ANIS per row, with the reported R", expected=1, section=17),
        "anis_used_per_row": Column("ANIS per row, with the R that was used", expected=1),
    }

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the four values of the metric by column name."""
        return {
            "anees": mean(sums.nees, sums.nees_rows),
            "anees_position": mean(sums.nees_position, float(sums.position_rows[0])),
            "anis_per_row": mean(sums.nis_per_row, sums.nis_updates),
            "anis_used_per_row": mean(sums.nis_used_per_row, sums.nis_used_updates),
        }


_SIGMAS = (1, 2, 3)


@register("metric", "coverage")
@dataclass(frozen=True)
class Coverage:
    """Fraction of the position errors within one, two and three sigmas of the filter.

    Let e_ia be the position error along axis a at row i, and P_i the covariance of the filter. The fraction is computed
    over the N counted rows and three axes::

        coverage_k_sigma_percent = 100/(3 N) |{i, a: |e_ia| <= k sqrt(P_i,aa)}|     expect 68.3, 95.4, 99.7

    The values are NaN if no row is counted. The metric is computed only on request: ``metrics=[coverage]``.
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "coverage_1_sigma_percent": Column(expected=68.3, reading="less is overconfident, more too cautious"),
        "coverage_2_sigma_percent": Column(expected=95.4, reading="less is overconfident, more too cautious"),
        "coverage_3_sigma_percent": Column(expected=99.7, reading="less is overconfident, more too cautious"),
    }

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values of the metric by column name."""
        rows, error = counted_errors(estimate, recording, counted)
        with np.errstate(invalid="ignore"):
            sigma = np.sqrt(np.diagonal(estimate.covariance[rows], axis1=1, axis2=2)[:, :3])
            shares = {k: float(np.mean(np.abs(error) <= k * sigma)) if rows.any() else np.nan for k in _SIGMAS}
        return {f"coverage_{k}_sigma_percent": 100 * share for k, share in shares.items()}


RULED_OUT = 3.0
"""Limit of a silent error in sigmas. A consistent filter exceeds this limit in 2.9 % of the rows (3 axes)."""


@register("metric", "silent_error")
@dataclass(frozen=True)
class SilentError(Summed):
    """Fraction and longest duration of position errors that exceed three sigmas of the filter.

    Only the first counted row of each second is used (N rows). Let e_i be the position error [m] and P_i its covariance
    in the filter [m2]. Row i has a silent error if sqrt(e_i' P_i^-1 e_i) > 3::

        silent_error_percent = 100/N |{i: silent}|          expect 2.9: chi-square with 3 degrees of freedom beyond 9
        silent_error_s       = the largest number of consecutive silent rows, one for each second [s]

    The metric detects a filter that is accurate on average, but has a large error and a small covariance for a minute.
    The values are NaN if no row is counted, or if a covariance is not positive definite.
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "silent_error_percent": Column("Position errors above 3 sigma of the filter"),
        "silent_error_s": Column("Longest time of a position error above 3 sigma of the filter"),
    }

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the two values of the metric by column name."""
        nees = squared_distances(sums.sampled_m, sums.sampled_covariance_m2)
        if not np.isfinite(nees).all() or not len(nees):
            return {"silent_error_percent": np.nan, "silent_error_s": np.nan}
        silent = nees > RULED_OUT**2
        longest = np.max(np.diff(streaks(silent)), initial=0)
        return {"silent_error_percent": 100 * float(silent.mean()), "silent_error_s": float(longest)}


def squared_distances(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return e' P^-1 e (k,) of errors (k, m) and covariances (k, m, m).

    The result is NaN for a covariance that is not finite or not positive definite.
    """
    finite: BoolArray = np.asarray(np.isfinite(covariance).all(axis=(1, 2)))
    identity = np.eye(error.shape[1])
    solvable = np.where(finite[:, None, None], covariance, identity)
    definite = np.linalg.eigvalsh(solvable)[:, 0] > 0
    white = np.linalg.solve(np.where(definite[:, None, None], solvable, identity), error[:, :, None])[:, :, 0]
    return np.where(finite & definite, np.sum(error * white, axis=1), np.nan)


@register("metric", "innovation")
@dataclass(frozen=True)
class Innovation:
    """Correlation of successive innovations. The innovations of an optimal filter are uncorrelated.

    Let rho_a(1) be the autocorrelation at lag 1 of row a of the innovations, and p_a the p value of its Ljung-Box test
    over 20 lags. Updates from the first counted row on are used::

        innovation_correlation   = mean over the rows of rho_a(1)               expect 0
        innovation_white_percent = fraction of the rows with p_a >= 0.05        expect 95

    A positive correlation means that the filter lags behind, because its process noise is too small. The values are NaN
    for fewer than 30 updates.
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "innovation_correlation": Column(
            "Correlation of successive innovations",
            expected=0,
            reading="more lags behind the measurements, less overshoots",
        ),
        "innovation_white_percent": Column(
            "Rows with white innovations", expected=95, reading="less means that innovations follow each other"
        ),
    }

    reads: ClassVar[str] = "updates"

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the two values of the metric by column name."""
        start_s = first_counted_s(recording.reference, estimate.index, counted)
        late = estimate.updates.innovation[estimate.updates.t_s >= start_s]
        tests = [test for test in whiteness_of_rows(late) if not np.isnan(test.first)]
        return {
            "innovation_correlation": float(np.mean([test.first for test in tests])) if tests else np.nan,
            "innovation_white_percent": 100 * float(np.mean([test.white for test in tests])) if tests else np.nan,
        }


@register("metric", "innovation_likelihood")
@dataclass(frozen=True)
class InnovationLikelihood:
    """Mean negative log-likelihood of the innovations; lower is better.

    Let y_k be the innovation of update k (m_k rows), and S_k = H P- H' + R its covariance with the reported R (scaled
    by ``r_scale``). The mean is computed over the N updates from the first counted row on::

        innovation_log_loss = 1/(2 N) sum (y_k' S_k^-1 y_k + log det S_k + m_k log 2 pi)      [nats per update]

    The metric does not need a reference. The R in S_k is the R before the adaptation, because an R that was fitted to
    y_k does not predict y_k. Only methods with the same measurements can be compared. The value is NaN if no update is
    used, or if the estimator does not store det S. The metric is computed only on request:
    ``metrics=[innovation_likelihood]``.

    Source: the prediction error decomposition (F. C. Schweppe, 1965, doi:10.1109/TIT.1965.1053737).
    """

    columns: ClassVar[Mapping[str, Column]] = {"innovation_log_loss": Column(judged=False)}

    default: ClassVar[bool] = False
    reads: ClassVar[str] = "updates"

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the value of the metric by column name."""
        updates = estimate.updates
        late = updates.t_s >= first_counted_s(recording.reference, estimate.index, counted)
        rows = updates.rows[late]
        losses = 0.5 * (updates.nis[late] + updates.log_det[late] + rows * np.log(2 * np.pi))[rows > 0]
        return {"innovation_log_loss": float(losses.mean()) if len(losses) else np.nan}


@register("metric", "log_score")
@dataclass(frozen=True)
class LogScore(Summed):
    """Mean negative log-density of the true position under the Gaussian of the filter; lower is better.

    Let e_i be the position error [m] and P_i its covariance in the filter [m2]. The mean is computed over the first
    counted row of each second (N rows)::

        position_log_score = 1/(2 N) sum (e_i' P_i^-1 e_i + log det P_i + 3 log 2 pi)         [nats, of metres]

    The score is proper: its expected value is lowest if the filter reports the true covariance of its errors. If the
    reference consists of withheld fixes, the metric is the score of the predicted fixes. The value is NaN if no row is
    counted, or if a covariance is not positive definite.

    Source: Gneiting and Raftery, "Strictly proper scoring rules, prediction, and estimation", JASA 102 (2007).
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "position_log_score": Column("Log score of the true position, lower is better", judged=False),
    }

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the value of the metric by column name."""
        error, covariance = sums.sampled_m, sums.sampled_covariance_m2
        if not len(error):
            return {"position_log_score": np.nan}
        with np.errstate(over="ignore", invalid="ignore"):
            losses = squared_distances(error, covariance) + np.linalg.slogdet(covariance)[1] + 3 * np.log(2 * np.pi)
            return {"position_log_score": float(np.mean(losses) / 2)}


def crps(error: FloatArray, sigma: FloatArray) -> FloatArray:
    """Return the continuous ranked probability score of Gaussians with standard deviation ``sigma``.

    ``error`` is the mean of the Gaussian minus the true value. The score has the unit of ``error``. Let z =
    error/sigma, and let phi and Phi be the density and the distribution function of the standard normal distribution::

        CRPS = sigma (z (2 Phi(z) - 1) + 2 phi(z) - 1/sqrt(pi))

    For a sigma of 0, the score is |error|. A lower score is better, and the minimum for a given sigma is 0.234 sigma.

    Source: Gneiting and Raftery, "Strictly proper scoring rules, prediction, and estimation", JASA 102 (2007), (21).
    """
    from scipy.special import ndtr

    certain = sigma == 0
    z = error / np.where(certain, 1.0, sigma)
    density = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)
    score = sigma * (z * (2 * ndtr(z) - 1) + 2 * density - 1 / np.sqrt(np.pi))
    return np.asarray(np.where(certain, np.abs(error), score), dtype=np.float64)


@register("metric", "crps")
@dataclass(frozen=True)
class Crps(Summed):
    """Mean continuous ranked probability score of the position under the Gaussian of the filter; lower is better.

    Let e_ia be the position error along axis a (east, north, up) [m], sigma_ia its standard deviation in the filter
    [m], and z = e/sigma. Let phi and Phi be the density and the distribution function of the standard normal
    distribution. The mean is computed over the axes and over the first counted row of each second (N rows)::

        position_crps_m = 1/(3 N) sum sigma (z (2 Phi(z) - 1) + 2 phi(z) - 1/sqrt(pi))

    The score is proper, like `log_score`. The score has the unit metre, and is not dominated by a single error of many
    sigmas. The value is NaN if no row is counted, or if a variance is negative.

    Source: Gneiting and Raftery, "Strictly proper scoring rules, prediction, and estimation", JASA 102 (2007), (21).
    """

    columns: ClassVar[Mapping[str, Column]] = {"position_crps_m": Column("CRPS of the position, mean of the axes")}

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the value of the metric by column name."""
        error, variance = sums.sampled_m, sums.sampled_m2[:, [0, 3, 5]]
        if len(error) == 0 or not (variance >= 0).all():
            return {"position_crps_m": np.nan}
        with np.errstate(over="ignore", invalid="ignore"):
            return {"position_crps_m": float(np.mean(crps(error, np.sqrt(variance))))}
