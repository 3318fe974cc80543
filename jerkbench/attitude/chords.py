"""Pairs of fixes that are far enough apart to show a course; none overlaps another."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.recording import Position

FINE_RAD = 0.05
"""A chord is as short as its course is this sure."""

COARSE_RAD = 0.15
"""Where none is for long, the surest does, if it is no less sure; fixes at rest then show none (a Rayleigh tail)."""

LONGEST_S = 30.0
"""A chord lasts no longer: what the speed did on the way is not known."""

LEAST_M = 1.0
"""A chord is no shorter: over less the antenna sways."""


class Chords(NamedTuple):
    """Ways from one fix to a later one, in the order of time; two have at most an end in common.

    Attributes:
        begin_s: (m,) time of the first fix.
        end_s: (m,) time of the second.
        way_m: (m, 2) east and north from the one to the other.
        sigma_rad: (m,) one standard deviation of its direction.
    """

    begin_s: FloatArray
    end_s: FloatArray
    way_m: FloatArray
    sigma_rad: FloatArray


def chords_of(position: Position | None, begin_s: float, end_s: float, least_m: float = LEAST_M) -> Chords:
    """Return the chords of the fixes between two times.

    With d the way, n across it and R_i, R_j the covariances of both fixes, horizontal::

        sigma = sqrt(n' (R_i + R_j) n)/|d|

    A chord ends with the first fix for which there is one before, not before the end of the last chord, with a sigma
    of `FINE_RAD`; of these the latest. Where there was none for `LONGEST_S`, the one with the least sigma is taken, if
    that is not above `COARSE_RAD`. Errors of successive chords correlate by at most -1/2, where they share a fix: who
    takes them for independent is too careful, for in a sum of chords the shared fix cancels.

    Args:
        position: the fixes, or None.
        begin_s: earlier fixes do not count.
        end_s: later ones do not either.
        least_m: shorter chords do not count.
    """
    if position is None:
        return Chords(np.empty(0), np.empty(0), np.empty((0, 2)), np.empty(0))
    known = np.isfinite(position.enu_m[:, :2]).all(axis=1) & (position.t_s >= begin_s) & (position.t_s <= end_s)
    t_s, places, covariance = position.t_s[known], position.enu_m[known, :2], position.covariance_m2[known, :2, :2]
    largest = np.asarray(np.linalg.eigvalsh(covariance)[:, 1], dtype=np.float64)
    begin, end = _pairs(t_s, places[:, 0] + 1j * places[:, 1], largest, least_m).T
    way_m = places[end] - places[begin]
    squared = np.einsum("ki,ki->k", way_m, way_m)
    across = np.column_stack([-way_m[:, 1], way_m[:, 0]])
    variance = np.einsum("ki,kij,kj->k", across, covariance[begin] + covariance[end], across) / squared**2
    return Chords(t_s[begin], t_s[end], way_m, np.sqrt(variance))


def _pairs(
    t_s: FloatArray, places: "np.ndarray[tuple[int], np.dtype[np.complex128]]", variance: FloatArray, least_m: float
) -> IntArray:
    """Rows (m, 2) of the fixes at both ends of each chord; ``variance`` (n,) is that of the worst direction."""
    pairs, free = [], 0
    earliest = np.searchsorted(t_s, t_s - LONGEST_S)
    for last in range(1, len(t_s)):
        first = max(free, int(earliest[last]))
        away = np.abs(places[last] - places[first:last])
        sigma = np.sqrt(variance[last] + variance[first:last]) / np.maximum(away, 1e-9)
        sigma[away < least_m] = np.inf
        fine = np.flatnonzero(sigma <= FINE_RAD)
        waited = t_s[last] - t_s[free] >= LONGEST_S
        if fine.size:
            pairs.append((first + int(fine[-1]), last))
        elif waited and sigma.size and sigma.min() <= COARSE_RAD:
            pairs.append((first + int(sigma.argmin()), last))
        else:
            continue
        free = last
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)
