"""Consistency of errors and innovations with what the filter claims of them, and proper scores of both."""

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
"""Of position and velocity: as many as there are."""


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

    columns: ClassVar[Mapping[str, Column]] = {
        "anees": Column("ANEES of position and velocity", expected=EXPECTED_ANEES, section=16),
        "anees_position": Column("ANEES of position", expected=3),
        "anis_per_row": Column("ANIS per row, with the reported R", expected=1, section=17),
        "anis_used_per_row": Column("ANIS per row, with the R that was used", expected=1),
    }

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the four values by column name."""
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
    """Share of the position errors within one, two and three sigmas.

    With e_ia the error of axis a at counted row i and P_i the covariance, over the N rows and three axes::

        coverage_k_sigma_percent = 100/(3 N) |{i, a: |e_ia| <= k sqrt(P_i,aa)}|     expect 68.3, 95.4, 99.7

    NaN without a row. Not computed unless asked for: ``metrics=[coverage]``.
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "coverage_1_sigma_percent": Column(expected=68.3, reading="less is overconfident, more too cautious"),
        "coverage_2_sigma_percent": Column(expected=95.4, reading="less is overconfident, more too cautious"),
        "coverage_3_sigma_percent": Column(expected=99.7, reading="less is overconfident, more too cautious"),
    }

    default: ClassVar[bool] = False

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the three values by column name."""
        rows, error = counted_errors(estimate, recording, counted)
        with np.errstate(invalid="ignore"):
            sigma = np.sqrt(np.diagonal(estimate.covariance[rows], axis1=1, axis2=2)[:, :3])
            shares = {k: float(np.mean(np.abs(error) <= k * sigma)) if rows.any() else np.nan for k in _SIGMAS}
        return {f"coverage_{k}_sigma_percent": 100 * share for k, share in shares.items()}


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

    columns: ClassVar[Mapping[str, Column]] = {
        "silent_error_percent": Column("Position errors above 3 sigma of the filter"),
        "silent_error_s": Column("Longest time of a position error above 3 sigma of the filter"),
    }

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the two values by column name."""
        nees = _squared_distances(sums.sampled_m, sums.sampled_covariance_m2)
        if not np.isfinite(nees).all() or not len(nees):
            return {"silent_error_percent": np.nan, "silent_error_s": np.nan}
        silent = nees > RULED_OUT**2
        longest = np.max(np.diff(streaks(silent)), initial=0)
        return {"silent_error_percent": 100 * float(silent.mean()), "silent_error_s": float(longest)}


def _squared_distances(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return (k,) e' P^-1 e; NaN where a covariance is not finite and positive definite."""
    finite: BoolArray = np.asarray(np.isfinite(covariance).all(axis=(1, 2)))
    solvable = np.where(finite[:, None, None], covariance, np.eye(3))
    definite = np.linalg.eigvalsh(solvable)[:, 0] > 0
    white = np.linalg.solve(np.where(definite[:, None, None], solvable, np.eye(3)), error[:, :, None])[:, :, 0]
    return np.where(finite & definite, np.sum(error * white, axis=1), np.nan)


@register("metric", "innovation")
@dataclass(frozen=True)
class Innovation:
    """Correlation of successive innovations: those of an optimal filter have none.

    With rho_a(1) the autocorrelation at lag 1 of row a of the innovations, from the first counted row on, and p_a the
    p of the Ljung-Box test over 20 lags::

        innovation_correlation   = mean over the rows of rho_a(1)               expect 0
        innovation_white_percent = share of the rows with p_a >= 0.05           expect 95

    Above 0 the filter lags behind: its process noise is too small for what happens. NaN with fewer than 30 updates.
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
        """Return the two values by column name."""
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
    """Mean negative log-likelihood of the innovations; the lowest is the best.

    With y_k the innovation of m_k rows and S_k = H P- H' + R, R as the filter is told it, over the N updates from the
    first counted row on::

        innovation_log_loss = 1/(2 N) sum (y_k' S_k^-1 y_k + log det S_k + m_k log 2 pi)      [nats an update]

    It needs no reference: a log of one's own will do. S is that before any adaptation has looked at the innovation: an
    R that was fitted to y_k itself foretells nothing. Between methods with other rows of z it cannot be compared. NaN
    without an update, or from an estimator that does not keep det S. Not computed unless asked for:
    ``metrics=[innovation_likelihood]``.

    Source: the prediction error decomposition (F. C. Schweppe, 1965, doi:10.1109/TIT.1965.1053737).
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "innovation_log_loss": Column(judged=False),
    }

    default: ClassVar[bool] = False
    reads: ClassVar[str] = "updates"

    def evaluate(self, estimate: Estimate, recording: Recording, counted: BoolArray) -> dict[str, float]:
        """Return the value by column name."""
        updates = estimate.updates
        late = updates.t_s >= first_counted_s(recording.reference, estimate.index, counted)
        rows = updates.rows[late]
        losses = 0.5 * (updates.nis[late] + updates.log_det[late] + rows * np.log(2 * np.pi))[rows > 0]
        return {"innovation_log_loss": float(losses.mean()) if len(losses) else np.nan}


@register("metric", "log_score")
@dataclass(frozen=True)
class LogScore(Summed):
    """Mean negative log-density of the true position under the filter's own Gaussian; the lowest is the best.

    With e_i the position error [m] and P_i its covariance [m2], over the N rows that are the first counted one of a
    second::

        position_log_score = 1/(2 N) sum (e_i' P_i^-1 e_i + log det P_i + 3 log 2 pi)         [nats, of metres]

    It is a proper score: no filter can improve it by claiming another covariance than that of its errors. Where the
    reference is made of withheld fixes, it is the score of the predicted measurement. NaN without a row, or where a
    covariance is not positive definite.

    Source: Gneiting and Raftery, "Strictly proper scoring rules, prediction, and estimation", JASA 102 (2007).
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "position_log_score": Column("Log score of the true position, lower is better", judged=False),
    }

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the value by column name."""
        return {"position_log_score": _mean_score(sums.sampled_m, sums.sampled_covariance_m2)}


def _mean_score(error: FloatArray, covariance: FloatArray) -> float:
    if len(error) == 0:
        return np.nan
    try:
        root = np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        return np.nan
    white = np.linalg.solve(root, error[:, :, None])[:, :, 0]
    log_det = 2 * np.sum(np.log(np.diagonal(root, axis1=1, axis2=2)), axis=1)
    with np.errstate(over="ignore", invalid="ignore"):
        return float(np.mean(np.sum(white**2, axis=1) + log_det + 3 * np.log(2 * np.pi)) / 2)


def crps(error: FloatArray, sigma: FloatArray) -> FloatArray:
    """Return the continuous ranked probability score of Gaussians that are wrong by ``error``, in its unit.

    With z = error/sigma, phi and Phi of the standard normal::

        CRPS = sigma (z (2 Phi(z) - 1) + 2 phi(z) - 1/sqrt(pi))

    Without a sigma it is |error|. The lowest is the best; 0.234 sigma is the least that a sigma promises.

    Source: Gneiting and Raftery, "Strictly proper scoring rules, prediction, and estimation", JASA 102 (2007), (21).
    """
    from scipy.special import ndtr

    certain = sigma == 0
    z = error / np.where(certain, 1.0, sigma)
    density = np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)
    score = sigma * (z * (2 * ndtr(z) - 1) + 2 * density - 1 / np.sqrt(np.pi))
    return np.asarray(np.where(certain, np.abs(error), score), dtype=np.float64)


def credibility(nees: FloatArray, ideal: FloatArray) -> tuple[float, float]:
    """Return two indices [dB] of (n,) NEES, beside those (n,) with the true mean square errors.

    ::

        NCI = 10/n sum |log10(nees_i/ideal_i)|

    The non-credibility index NCI: 0 is credible; 10 says that the covariances are wrong by a factor of ten on average,
    either way. The inclination indicator is the same without the absolute value, above 0 overconfident.

    Source: Li, Zhao and Li, "Estimator's credibility and its measures", IFAC World Congress (2002).
    """
    known = (nees > 0) & (ideal > 0) & np.isfinite(nees) & np.isfinite(ideal)
    logs = np.log10(nees[known] / ideal[known])
    return (float(10 * np.mean(np.abs(logs))), float(10 * np.mean(logs))) if known.any() else (np.nan, np.nan)


@register("metric", "crps")
@dataclass(frozen=True)
class Crps(Summed):
    """Mean continuous ranked probability score of the filter's own Gaussian of the position; the lowest is the best.

    With e_ia the error of axis a (east, north, up) [m], sigma_ia what the filter's covariance says of it, z = e/sigma,
    phi and Phi of the standard normal, over the N rows that are the first counted one of a second::

        position_crps_m = 1/(3 N) sum sigma (z (2 Phi(z) - 1) + 2 phi(z) - 1/sqrt(pi))

    A proper score, as `log_score` is, but in metres, and a single error that the filter had ruled out does not decide
    it. NaN without a row, or where a variance is negative.

    Source: Gneiting and Raftery, "Strictly proper scoring rules, prediction, and estimation", JASA 102 (2007), (21).
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "position_crps_m": Column("CRPS of the position, mean of the axes"),
    }

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the value by column name."""
        error, variance = sums.sampled_m, sums.sampled_m2[:, [0, 3, 5]]
        if len(error) == 0 or not (variance >= 0).all():
            return {"position_crps_m": np.nan}
        with np.errstate(over="ignore", invalid="ignore"):
            return {"position_crps_m": float(np.mean(crps(error, np.sqrt(variance))))}


@register("metric", "credibility")
@dataclass(frozen=True)
class Credibility(Summed):
    """Non-credibility index and inclination indicator of the position.

    With e_i the position error, P_i its covariance and S = 1/N sum e_i e_i' over the N rows that are the first counted
    one of a second, which stands for the true mean square error::

        rho_i = e_i' P_i^-1 e_i / (e_i' S^-1 e_i)
        non_credibility_db = 10/N sum |log10 rho_i|     0 is credible, 10 a factor of ten either way
        inclination_db     = 10/N sum log10 rho_i       above 0 overconfident, below it too cautious

    A single large error does not decide them, as it does ANEES. S is over the rows of one run, not over runs at one
    time: where the errors grow and shrink within a run, some of the index is that. NaN of fewer than four rows. Not
    computed unless asked for: ``metrics=[credibility]``.

    Source: Li, Zhao and Li, "Estimator's credibility and its measures", IFAC World Congress (2002).
    """

    columns: ClassVar[Mapping[str, Column]] = {
        "non_credibility_db": Column("Non-credibility index of the position"),
        "inclination_db": Column("Inclination indicator of the covariances of the position", expected=0),
    }

    default: ClassVar[bool] = False

    def summarise(self, sums: Sums) -> dict[str, float]:
        """Return the two values by column name."""
        error = sums.sampled_m
        square = error.T @ error / max(1, len(error))
        if len(error) < 4 or not np.isfinite(square).all() or np.linalg.matrix_rank(square) < 3:
            return {"non_credibility_db": np.nan, "inclination_db": np.nan}
        nees = _squared_distances(error, sums.sampled_covariance_m2)
        ideal = _squared_distances(error, np.broadcast_to(square, (len(error), 3, 3)))
        return dict(zip(("non_credibility_db", "inclination_db"), credibility(nees, ideal), strict=True))
