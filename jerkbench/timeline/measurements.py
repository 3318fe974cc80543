"""(Recording, Attitude) -> Measurements: position and velocity as rows of z = [p; v]."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, IntArray
from jerkbench.estimate import Attitude
from jerkbench.recording import Recording, Velocity

FLOOR = 1e-6
"""No variance is taken below (1 mm)^2 or (1 mm/s)^2."""

ABSENT_SIGMA_MPS = 100.0
"""One sigma of what a speed does not tell: far more than any vehicle's, and still well conditioned."""


@dataclass(frozen=True, eq=False)
class Measurements:
    """Measurements in the order of time; what comes at the same time is one row.

    Attributes:
        t_ns: (m,) time at which they were true.
        z: (m, 6) position and velocity in ENU; NaN: not there.
        R: (m, 6, 6) as reported, the diagonal not below the floor.
        R_true: (m, 6, 6) what the errors were drawn from, where it is known; else R.
    """

    t_ns: IntArray
    z: FloatArray
    R: FloatArray
    R_true: FloatArray

    def covariances(self, *, true: bool) -> FloatArray:
        """Return (m, 6, 6) those that a filter gets."""
        return self.R_true if true else self.R


def gather(recording: Recording, attitude: Attitude) -> Measurements:
    """Merge the position and velocity of ``recording`` into rows of z."""
    streams = []
    if recording.position is not None:
        p = recording.position
        true = p.covariance_m2 if p.true_covariance_m2 is None else p.true_covariance_m2
        streams.append((0, p.t_s, p.enu_m, p.covariance_m2, true))
    if recording.velocity is not None:
        v = velocity_in_enu(recording.velocity, attitude)
        true = v.covariance_m2ps2 if v.true_covariance_m2ps2 is None else v.true_covariance_m2ps2
        streams.append((3, v.t_s, v.mps, v.covariance_m2ps2, true))
    stamps = [np.round(t_s * 1e9).astype(np.int64) for _, t_s, *_ in streams]
    t_ns = np.unique(np.concatenate([*stamps, np.empty(0, dtype=np.int64)]))
    z, R, R_true = np.full((len(t_ns), 6), np.nan), *np.tile(np.eye(6), (2, len(t_ns), 1, 1))
    for (at, _, values, reported, true), stamp in zip(streams, stamps, strict=True):
        rows, block = np.searchsorted(t_ns, stamp), slice(at, at + 3)
        z[rows, block], R[rows, block, block], R_true[rows, block, block] = values, reported, true
    present = np.isfinite(z).any(axis=1)
    return Measurements(t_ns[present], z[present], floored(R[present]), floored(R_true[present]))


def velocity_in_enu(velocity: Velocity, attitude: Attitude) -> Velocity:
    """Turn a velocity along the body's axes, and its covariances, into ENU; one that is in ENU stays as it is.

    With Omega of the last IMU stamp before it, v in the frame "body" or "speed" and C its covariance::

        z = Omega v;  R = Omega C Omega'

    An axis of "speed" that nothing is known of is 0 with the variance (100 m/s)^2, uncorrelated: once turned, only that
    much in R says that it is absent, for the rows of z are those of ENU. A speed alone is so one quantity in three
    rows; a rule that adds up variances, or takes the diagonal alone, sees little in them.
    """
    if velocity.frame == "enu":
        return velocity
    sample = np.maximum(np.searchsorted(attitude.t_s, velocity.t_s, side="right") - 1, 0)
    omega = attitude.dcm[sample]
    absent = ~np.isfinite(velocity.mps)
    absent[absent.all(axis=1)] = False  # such a row stays absent as a whole
    true = velocity.true_covariance_m2ps2
    return Velocity(
        velocity.t_s,
        np.einsum("nij,nj->ni", omega, np.where(absent, 0.0, velocity.mps)),
        _turned(omega, _widened(velocity.covariance_m2ps2, absent)),
        "enu",
        None if true is None else _turned(omega, _widened(true, absent)),
    )


def floored(covariance: FloatArray) -> FloatArray:
    """Raise each diagonal element to the floor; the off-diagonals stay."""
    raised = covariance.copy()
    diagonal = np.einsum("nii->ni", raised)
    np.maximum(diagonal, FLOOR, out=diagonal)
    return raised


def _widened(covariance: FloatArray, absent: BoolArray) -> FloatArray:
    """The covariance with the variance of an absent axis where ``nothing`` (n, 3) is known."""
    either = absent[:, :, None] | absent[:, None, :]
    return np.where(either, ABSENT_SIGMA_MPS**2 * np.eye(3), covariance)


def _turned(omega: FloatArray, covariance: FloatArray) -> FloatArray:
    """Omega C Omega', symmetric to the bit."""
    turned = np.einsum("nij,njk,nlk->nil", omega, covariance, omega)
    return np.asarray(0.5 * (turned + turned.transpose(0, 2, 1)))
