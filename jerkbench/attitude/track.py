"""Yaw from the track of the fixes: pairs far enough apart, their courses, with the gyro between, and its bias."""

from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.geometry import wrap_angle
from jerkbench.recording import Position

# Pairs of fixes that are far enough apart to show a course; none overlaps another.

FINE_RAD = 0.05
"""A chord is as short as its course is this sure."""

COARSE_RAD = 0.15
"""Where none is for long, the surest does, if it is no less sure; fixes at rest then show none (a Rayleigh tail)."""

LONGEST_S = 30.0
"""A chord lasts no longer: what the speed did on the way is not known."""

LEAST_CHORD_M = 1.0
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


def chords_of(position: Position | None, begin_s: float, end_s: float, least_m: float = LEAST_CHORD_M) -> Chords:
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


TURN_ON_RADPS = 0.01
"""One sigma of the yaw gyro's bias where no rest shows it."""

YAW_BIAS_WALK = 1e-5
"""Random walk of that bias [rad/s/sqrt(s)]."""

REST_S = 1.0
"""The shortest rest that shows it."""

UNSTEADY_MPS2 = 1.0
"""One sigma of the acceleration along a chord; the speed's slope over it is not known."""

CONTRADICTION_SIGMAS = 5.0
"""A course that is further off contradicts what was known."""


class Track(NamedTuple):
    """The yaw from the track of the fixes.

    Attributes:
        chords: at least one.
        rest_s: how long the vehicle stands still at the start.
    """

    chords: Chords
    rest_s: float


class Courses(NamedTuple):
    """The offset between yaw and the integrated yaw rate psi, as each chord shows it.

    Attributes:
        t_s: (m,) when it is known: the chord's end.
        lag_s: (m,) how long before that it held: half the chord's length.
        offset_rad: (m,).
        sigma_rad: (m,).
    """

    t_s: FloatArray
    lag_s: FloatArray
    offset_rad: FloatArray
    sigma_rad: FloatArray


class Drift(NamedTuple):
    """The filter's state after some courses.

    Attributes:
        t_s: (k,) times.
        x: (k, 2) the offset, and its rate: the gyro's bias with the sign turned.
        P: (k, 2, 2) their covariance.
    """

    t_s: FloatArray
    x: FloatArray
    P: FloatArray


def courses_of(chords: Chords, nodes_s: FloatArray, psi_rad: FloatArray, sigma_min_rad: float) -> Courses:
    r"""Refer the direction of each chord d to the gyro.

    A vehicle that drives forwards at a constant speed covers d = v e^{i offset} G with G = int e^{i psi} dt over the
    chord, so that offset = arg d - arg G, whatever its turns. A slope a of the speed adds a int (t - middle) e^{i psi}
    dt = a M, which turns it by a Im(M conj G)/(v |G|^2), v = |d|/|G|; a has the sigma of 1 m/s2, or of v over the
    chord's length where that is less::

        sigma^2 = max(sigma of the chord, sigma_min)^2 + (a Im(M conj G)/(|d| |G|))^2

    Args:
        chords: of the fixes.
        nodes_s: (n,) times at which psi is known.
        psi_rad: (n,) the integrated yaw rate there.
        sigma_min_rad: least standard deviation of a course.
    """
    turn, step_s = np.exp(1j * psi_rad), np.diff(nodes_s)
    since_s = nodes_s - nodes_s[0]
    G, M = (np.concatenate(([0], np.cumsum(0.5 * (f[1:] + f[:-1]) * step_s))) for f in (turn, turn * since_s))
    begin_s, end_s = chords.begin_s, chords.end_s
    G, M = (np.interp(end_s, nodes_s, f) - np.interp(begin_s, nodes_s, f) for f in (G, M))
    M -= (0.5 * (begin_s + end_s) - nodes_s[0]) * G
    length_m, size = np.linalg.norm(chords.way_m, axis=1), np.maximum(np.abs(G), 1e-9)
    slope = np.minimum(UNSTEADY_MPS2, length_m / size / (end_s - begin_s))
    unsteady = slope * (M * np.conj(G)).imag / (length_m * size)
    direction = np.arctan2(chords.way_m[:, 1], chords.way_m[:, 0])
    sigma = np.hypot(np.maximum(chords.sigma_rad, sigma_min_rad), unsteady)
    return Courses(end_s, 0.5 * (end_s - begin_s), wrap_angle(direction - np.angle(G)), sigma)


def filter_drift(courses: Courses, rate: tuple[float, float], walk_rad_per_sqrt_s: float) -> Drift:
    """Return offset and rate after the courses.

    F = [[1, dt], [0, 1]];  Q = dt diag(walk^2, (1e-5)^2);  H = [1, -lag];  innovation wrapped to (-pi, pi]. A course
    more than five sigmas off is dropped; the next one that contradicts as well, and agrees with it, starts anew.

    Args:
        courses: at least one.
        rate: the offset's rate before the first, and its sigma.
        walk_rad_per_sqrt_s: random walk of yaw.
    """
    states: list[tuple[float, FloatArray, FloatArray]] = []
    dropped, prior = -1, np.array(rate)
    for k, (t, lag, z, sigma) in enumerate(zip(*(part.tolist() for part in courses), strict=True)):
        if not states:
            states.append((t, *_begun(z, lag, sigma, prior[0], prior[1] ** 2)))
            continue
        since, x, P = states[-1]
        F = np.array([[1.0, t - since], [0.0, 1.0]])
        x, P = F @ x, F @ P @ F.T + (t - since) * np.diag([walk_rad_per_sqrt_s**2, YAW_BIAS_WALK**2])
        H = np.array([1.0, -lag])
        innovation, S = float(wrap_angle(z - H @ x)), float(H @ P @ H) + sigma**2
        if innovation**2 <= CONTRADICTION_SIGMAS**2 * S:
            K = P @ H / S
            states.append((t, x + K * innovation, P - np.outer(K, K) * S))
        elif dropped == k - 1 and _agree(courses, k - 1, k):  # two that contradict what was known, and not each other
            states.append((t, *_begun(z, lag, sigma, x[1], P[1, 1])))
        else:
            dropped = k
    return Drift(*(np.array(part) for part in zip(*states, strict=True)))


def rate_at_rest(t_s: FloatArray, rate_radps: FloatArray, rest_s: float, walk: float) -> tuple[float, float]:
    """Return the offset's rate, and its sigma, from the mean yaw rate over the rest; without a rest 0 +- .01 rad/s."""
    rows = t_s <= rest_s
    if rest_s < REST_S or not rows.any():
        return 0.0, TURN_ON_RADPS
    return -float(rate_radps[rows].mean()), float(np.hypot(walk / np.sqrt(rest_s), YAW_BIAS_WALK * np.sqrt(rest_s)))


def offsets_at(drift: Drift, t_s: FloatArray, walk: float) -> tuple[FloatArray, FloatArray]:
    """Return the offset (n,) at ``t_s`` (n,) from the courses up to then, and its sigma; before the first, from it."""
    latest = np.maximum(np.searchsorted(drift.t_s, t_s, side="right") - 1, 0)
    since_s, x, P = t_s - drift.t_s[latest], drift.x[latest], drift.P[latest]
    variance = P[:, 0, 0] + 2 * since_s * P[:, 0, 1] + since_s**2 * P[:, 1, 1] + np.abs(since_s) * walk**2
    return x[:, 0] + since_s * x[:, 1], np.sqrt(variance)


def _begun(z: float, lag: float, sigma: float, rate: float, variance: float) -> tuple[FloatArray, FloatArray]:
    """State and covariance after one course, z = offset - lag rate."""
    P = np.array([[sigma**2 + lag**2 * variance, lag * variance], [lag * variance, variance]])
    return np.array([z + lag * rate, rate]), P


def _agree(courses: Courses, first: int, second: int) -> bool:
    difference = wrap_angle(courses.offset_rad[second] - courses.offset_rad[first])
    return bool(abs(difference) <= CONTRADICTION_SIGMAS * np.hypot(courses.sigma_rad[first], courses.sigma_rad[second]))
