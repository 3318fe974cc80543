"""The real errors of a receiver against its stated sigmas."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.recording import Recording

LEAST_ROWS = 10

MEDIAN_OF_SQUARE = 0.455
"""Median of chi-square with one degree of freedom."""

REST, REFERENCE = "scatter at rest", "error against the reference"


@dataclass(frozen=True)
class Sigma:
    """One standard deviation of a stream, stated and real.

    Attributes:
        stream: "position" or "velocity".
        unit: "m" or "m/s".
        basis: where the real one comes from: the scatter at rest, which a slow error does not show in, or the error
            against the reference.
        stated: (3,) root of the mean stated variance on each axis.
        real: (3,) root mean square on each axis.
        ratio: root of the mean of e' R^-1 e an axis; 1: as stated, 2: twice as large.
        median_ratio: the same of the middle of the errors east and north: no tail counts.
        rows: over how many.
    """

    stream: str
    unit: str
    basis: str
    stated: FloatArray
    real: FloatArray
    ratio: float
    median_ratio: float
    rows: int


def stated_against_real_sigma(recording: Recording) -> list[Sigma]:
    """Return what can be told of position and ENU velocity: at rest at the start, and against the reference.

    A reference whose places are the fixes themselves says nothing of them; it is left out. The reference is taken
    linearly between its stamps, where these are no further apart than 0.5 s. A row need not have all axes.
    """
    sigmas = []
    for name, unit, t_s, values, covariance in stated_streams(recording):
        still = (t_s >= 0) & (t_s < recording.static_start_s)
        if _enough(values[still]):
            centre = np.nanmean(values[still], axis=0) if name == "position" else np.zeros(3)
            sigmas.append(_sigma(name, unit, REST, values[still] - centre, covariance[still]))
        error = values - _truth(recording, name, t_s)
        known = np.isfinite(error).any(axis=1)
        if _enough(error[known]) and (np.nan_to_num(error) != 0).any():
            sigmas.append(_sigma(name, unit, REFERENCE, error[known], covariance[known]))
    return sigmas


def _enough(values: FloatArray) -> bool:
    """Whether each axis is there often enough."""
    return bool((np.isfinite(values).sum(axis=0) >= LEAST_ROWS).all())


def stated_streams(recording: Recording) -> list[tuple[str, str, FloatArray, FloatArray, FloatArray]]:
    """Return name, unit, times (m,), values (m, 3) and covariances (m, 3, 3) of position and ENU velocity."""
    streams = []
    if recording.position is not None:
        p = recording.position
        streams.append(("position", "m", p.t_s, p.enu_m, p.covariance_m2))
    if recording.velocity is not None and recording.velocity.frame == "enu":
        v = recording.velocity
        streams.append(("velocity", "m/s", v.t_s, v.mps, v.covariance_m2ps2))
    return streams


def _truth(recording: Recording, stream: str, t_s: FloatArray) -> FloatArray:
    """(m, 3) the reference at ``t_s``; NaN where it is not known near."""
    reference = recording.reference
    values = reference.enu_m if stream == "position" else reference.velocity_mps
    if values is None or len(reference.t_s) < 2:
        return np.full((len(t_s), 3), np.nan)
    after = np.clip(np.searchsorted(reference.t_s, t_s), 1, len(reference.t_s) - 1)
    near = (reference.t_s[after] - reference.t_s[after - 1] <= NEAR_S)[:, None]
    inside = ((t_s >= reference.t_s[0]) & (t_s <= reference.t_s[-1]))[:, None]
    truth = np.column_stack([np.interp(t_s, reference.t_s, values[:, axis]) for axis in range(3)])
    return np.where(near & inside, truth, np.nan)


NEAR_S = 0.5
"""Over a longer interval of the reference a straight line says little."""


def _sigma(name: str, unit: str, basis: str, error: FloatArray, covariance: FloatArray) -> Sigma:
    """Of errors (k, 3), NaN where an axis was not measured."""
    measured = np.isfinite(error)
    known, both_measured = np.where(measured, error, 0.0), measured[:, :, None] & measured[:, None, :]
    weighed = np.linalg.solve(np.where(both_measured, covariance, np.eye(3)), known[:, :, None])[:, :, 0]
    squares = np.einsum("ki,ki->k", known, weighed)
    variances = np.where(measured, np.diagonal(covariance, axis1=1, axis2=2), np.nan)
    return Sigma(
        stream=name,
        unit=unit,
        basis=basis,
        stated=np.sqrt(np.nanmean(variances, axis=0)),
        real=np.sqrt(np.nanmean(error**2, axis=0)),
        ratio=float(np.sqrt(squares.sum() / measured.sum())),
        median_ratio=float(np.sqrt(np.nanmedian((error**2 / variances)[:, :2]) / MEDIAN_OF_SQUARE)),
        rows=len(error),
    )
