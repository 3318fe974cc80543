"""The sums of a run from its trajectory, in a dozen passes of NumPy: what the compiled pass is compared with."""

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.estimate import Estimate, Sums, Updates
from jerkbench.evaluation.counted_rows import (
    POSITION_AXES,
    VELOCITY_AXES,
    Rows,
    counting,
    position_error_m,
    velocity_error_mps,
)
from jerkbench.recording import Recording

UPPER = np.triu_indices(3)
"""Where the covariance of a position has numbers of its own."""

BLOCK = 2048
"""Rows whose covariances are taken together: they fit into a processor's second cache."""


def sums_of(estimate: Estimate, recording: Recording, counted: BoolArray) -> Sums:
    """Return the sums of a trajectory; ``counted`` (k,) says which of its rows count."""
    rows = counting(estimate.index, recording, counted)
    position, velocity = position_error_m(estimate, recording), velocity_error_mps(estimate, recording)
    p2 = _squares(position, recording.reference.enu_m, estimate)
    v2 = _squares(velocity, recording.reference.velocity_mps, estimate)
    norm2 = p2.sum(axis=1)
    nees, nees_position = _nees(np.hstack([position, velocity]), estimate.covariance, rows)
    nis, nis_updates, used, used_updates = _nis(estimate.updates, rows.start_s)
    with np.errstate(over="ignore", invalid="ignore"):
        return Sums(
            position_m2=_over_axes(p2, rows.position, tuple(POSITION_AXES.values())),
            position_rows=rows.position.sum(axis=1).astype(np.float64),
            position_max_m=float(np.sqrt(norm2[rows.position[0]]).max()) if rows.position[0].any() else float("nan"),
            with_burn_in_m2=float(norm2[rows.with_burn_in].sum()),
            rows_with_burn_in=float(rows.with_burn_in.sum()),
            velocity_m2ps2=_over_axes(v2, rows.velocity, tuple(VELOCITY_AXES.values())),
            velocity_rows=rows.velocity.sum(axis=1).astype(np.float64),
            nees=nees,
            nees_rows=float(rows.both.sum()),
            nees_position=nees_position,
            nis_per_row=nis,
            nis_updates=nis_updates,
            nis_used_per_row=used,
            nis_used_updates=used_updates,
            outage_m2=float(norm2[rows.outage].sum()),
            outage_rows=float(rows.outage.sum()),
            outage_ends_m=np.sqrt(norm2[rows.outages[:, 1]]),
            outage_driven_m=rows.outages_driven_m,
            outage_drifts_mps=drifts_mps(position[rows.outages], rows.outages_s),
            outages=len(recording.outages_s),
            sampled_m=position[rows.sampled],
            sampled_m2=estimate.covariance[rows.sampled][:, *UPPER],
        )


def drifts_mps(error_m: FloatArray, t_s: FloatArray) -> FloatArray:
    """Return (j,) |e_last - e_first|/(t_last - t_first) of errors (j, 2, 3) at times (j, 2)."""
    with np.errstate(all="ignore"):
        grown = np.linalg.norm(error_m[:, 1] - error_m[:, 0], axis=1)
        return np.asarray(grown / np.where(t_s[:, 1] > t_s[:, 0], t_s[:, 1] - t_s[:, 0], np.nan))


def nested_squares(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return (n, k): e' P^-1 e of the first 1, 2, ..., n states of k rows of errors (k, n) and covariances (k, n, n).

    By elimination, P = L D L', all rows of a block in step. NaN from the first pivot on that is not positive.
    """
    squares = np.empty(error.shape[::-1])
    for begin in range(0, len(error), BLOCK):
        block = slice(begin, begin + BLOCK)
        _eliminate(error[block].T.copy(), covariance[block].transpose(1, 2, 0).copy(), squares[:, block])
    return squares.cumsum(axis=0)


def _eliminate(e: FloatArray, P: FloatArray, squares: FloatArray) -> None:
    """Fill ``squares`` (n, k) with the share of each state; e (n, k) and P (n, n, k) are spoilt."""
    with np.errstate(all="ignore"):
        for c in range(len(e)):
            pivot = np.where(P[c, c] > 0, P[c, c], np.nan)
            squares[c] = e[c] ** 2 / pivot
            factor = P[c, c + 1 :] / pivot
            e[c + 1 :] -= factor * e[c]
            for r in range(c + 1, len(e)):
                P[r, r:] -= factor[r - c - 1] * P[c, r:]


def _squares(error: FloatArray, truth: FloatArray | None, estimate: Estimate) -> FloatArray:
    """(k, 3) squared errors, 0 where the reference is not known."""
    if truth is None:
        return np.zeros_like(error)
    with np.errstate(over="ignore", invalid="ignore"):
        return np.where(np.isfinite(truth[estimate.index]), error**2, 0.0)


def _over_axes(squares: FloatArray, rows: BoolArray, axes: tuple[tuple[int, ...], ...]) -> FloatArray:
    """Sum of ``squares`` (k, 3) over the axes and the rows of each set."""
    return np.array([squares[which][:, select].sum() for which, select in zip(rows, axes, strict=True)])


def _nees(error: FloatArray, covariance: FloatArray, rows: Rows) -> tuple[float, float]:
    located = rows.position[0]
    squares = (
        nested_squares(error, covariance) if located.all() else nested_squares(error[located], covariance[located])
    )
    with np.errstate(over="ignore", invalid="ignore"):
        return float(squares[5, rows.both[located]].sum()), float(squares[2].sum())


def _nis(updates: Updates, start_s: float) -> tuple[float, float, float, float]:
    late = updates.t_s >= start_s
    kept = updates.rows[late] - np.isinf(updates.R_diagonal[late]).sum(axis=1)
    return *_per_row(updates.nis[late], updates.rows[late]), *_per_row(updates.nis_used[late], kept)


def _per_row(nis: FloatArray, rows: FloatArray) -> tuple[float, float]:
    measured = rows > 0
    return float((nis[measured] / rows[measured]).sum()), float(measured.sum())
