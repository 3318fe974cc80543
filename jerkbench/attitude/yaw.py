"""Yaw filter, which combines the gyro with headings, the course of a velocity, or the track of the fixes."""

import math
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.errors import RecordingError
from jerkbench.geometry import wrap_angle
from jerkbench.recording import HEADING_SOURCES, Heading, Imu, Position, Recording, Velocity

# A chord connects two fixes whose distance is large enough to determine a course. Chords do not overlap in time.

FINE_RAD = 0.05
"""Maximum standard deviation of the course of a chord [rad]. A chord is as short as this limit allows."""

COARSE_RAD = 0.15
"""Maximum standard deviation of a chord that is used if no chord below `FINE_RAD` exists for `MAX_CHORD_S` [rad].

Fixes of a vehicle at rest rarely form a chord below this limit, because the distance between two fixes has a Rayleigh
distribution.
"""

MAX_CHORD_S = 30.0
"""Maximum duration of a chord [s], because the variation of the speed within a chord is not known."""

MIN_CHORD_M = 1.0
"""Minimum length of a chord [m], because the antenna moves relative to the vehicle."""


class Chords(NamedTuple):
    """Chords, which are vectors between two fixes, sorted by time. Two chords have at most one fix in common.

    Attributes:
        begin_s: (m,) time of the first fix of each chord [s].
        end_s: (m,) time of the second fix of each chord [s].
        way_m: (m, 2) vector (east, north) from the first to the second fix of each chord [m].
        sigma_rad: (m,) standard deviation of the direction of each chord [rad].
    """

    begin_s: FloatArray
    end_s: FloatArray
    way_m: FloatArray
    sigma_rad: FloatArray


def chords_of(position: Position | None, begin_s: float, end_s: float, least_m: float = MIN_CHORD_M) -> Chords:
    """Return the chords of the fixes between the times ``begin_s`` and ``end_s``.

    A chord with the horizontal vector d and its unit normal n connects two fixes with the covariances R_i and R_j. The
    standard deviation sigma of the direction of the chord is computed from these quantities::

        sigma = sqrt(n' (R_i + R_j) n)/|d|

    A chord does not start before the end of the previous chord. A chord ends at the first fix for which an earlier fix
    with a sigma of at most `FINE_RAD` exists, and starts at the latest of these earlier fixes. If no chord with a sigma
    of at most `FINE_RAD` exists for `MAX_CHORD_S`, the chord with the smallest sigma is used, if this sigma is at most
    `COARSE_RAD`. Consecutive chords may have a fix in common, so the correlation of their errors is between -1/2 and 0.
    The yaw filter treats the errors as independent, which is conservative, because the error of the common fix cancels
    in the sum of two consecutive chords.

    Args:
        position: fixes of the recording; None if the recording has no fixes.
        begin_s: fixes before this time are ignored [s].
        end_s: fixes after this time are ignored [s].
        least_m: minimum length of a chord [m].
    """
    if position is None:
        return Chords(np.empty(0), np.empty(0), np.empty((0, 2)), np.empty(0))
    known = np.isfinite(position.enu_m[:, :2]).all(axis=1) & (position.t_s >= begin_s) & (position.t_s <= end_s)
    t_s, enu_m, covariance = position.t_s[known], position.enu_m[known, :2], position.covariance_m2[known, :2, :2]
    largest = np.asarray(np.linalg.eigvalsh(covariance)[:, 1], dtype=np.float64)
    start, end = _pairs(t_s, enu_m[:, 0] + 1j * enu_m[:, 1], largest, least_m).T
    way_m = enu_m[end] - enu_m[start]
    squared = np.einsum("ki,ki->k", way_m, way_m)
    across = np.column_stack([-way_m[:, 1], way_m[:, 0]])
    variance = np.einsum("ki,kij,kj->k", across, covariance[start] + covariance[end], across) / squared**2
    return Chords(t_s[start], t_s[end], way_m, np.sqrt(variance))


def _pairs(
    t_s: FloatArray, enu_m: "np.ndarray[tuple[int], np.dtype[np.complex128]]", variance: FloatArray, least_m: float
) -> IntArray:
    """Return the row indices (m, 2) of the first and the last fix of each chord.

    The argument ``variance`` (n,) is the horizontal variance of each fix in the least accurate direction [m2].
    """
    pairs, free = [], 0
    earliest = np.searchsorted(t_s, t_s - MAX_CHORD_S)
    for last in range(1, len(t_s)):
        first = max(free, int(earliest[last]))
        distance = np.abs(enu_m[last] - enu_m[first:last])
        sigma = np.sqrt(variance[last] + variance[first:last]) / np.maximum(distance, 1e-9)
        sigma[distance < least_m] = np.inf
        fine = np.flatnonzero(sigma <= FINE_RAD)
        waited = t_s[last] - t_s[free] >= MAX_CHORD_S
        if fine.size:
            pairs.append((first + int(fine[-1]), last))
        elif waited and sigma.size and sigma.min() <= COARSE_RAD:
            pairs.append((first + int(sigma.argmin()), last))
        else:
            continue
        free = last
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


TURN_ON_RADPS = 0.01
"""Standard deviation of the gyro bias about the vertical axis, if the vehicle is not at rest at the start [rad/s]."""

YAW_BIAS_WALK = 1e-5
"""Random walk of the gyro bias about the vertical axis [rad/s/sqrt(s)]."""

REST_S = 1.0
"""Minimum time at rest to estimate the gyro bias about the vertical axis [s]."""

UNSTEADY_MPS2 = 1.0
"""Standard deviation of the unknown acceleration along a chord [m/s2]."""

CONTRADICTION_SIGMAS = 5.0
"""Maximum innovation of a course, in standard deviations. A course with a larger innovation is an outlier."""


class Track(NamedTuple):
    """The track of the fixes as a source of the yaw.

    Attributes:
        chords: chords of the fixes, at least one.
        rest_s: duration of the rest at the start of the recording [s].
    """

    chords: Chords
    rest_s: float


class Courses(NamedTuple):
    """Measurements of the offset between the yaw and psi, the integrated yaw rate. Each chord gives one measurement.

    Attributes:
        t_s: (m,) time of each measurement, which is the end of the chord [s].
        lag_s: (m,) time from the middle of the chord, to which the measured offset refers, to the end of the chord [s].
        offset_rad: (m,) measured offset between the yaw and psi [rad].
        sigma_rad: (m,) standard deviation of the measured offset [rad].
    """

    t_s: FloatArray
    lag_s: FloatArray
    offset_rad: FloatArray
    sigma_rad: FloatArray


class Drift(NamedTuple):
    """State estimates of the yaw filter after each accepted course.

    Attributes:
        t_s: (k,) times of the accepted courses [s].
        x: (k, 2) offset between the yaw and psi [rad], and its rate [rad/s], which is the negative gyro bias.
        P: (k, 2, 2) covariances of x.
    """

    t_s: FloatArray
    x: FloatArray
    P: FloatArray


def courses_of(chords: Chords, nodes_s: FloatArray, psi_rad: FloatArray, sigma_min_rad: float) -> Courses:
    r"""Compute the offset between the yaw and psi, the integrated yaw rate, for each chord.

    If a vehicle drives forwards at a constant speed v, a chord is d = v e^{i offset} G, where G is the integral of e^{i
    psi} over the chord. Therefore, the offset is arg d - arg G for any turns within the chord. A constant acceleration
    a adds the term a M to v G, where M is the integral of (t - middle) e^{i psi}. The term a M changes the direction of
    the chord by a Im(M conj G)/(v |G|^2), with v = |d|/|G|. The standard deviation of the acceleration a is assumed to
    be 1 m/s2, or v divided by the duration of the chord if this quotient is smaller. The variance of the offset
    includes the effect of a::

        sigma^2 = max(sigma of the chord, sigma_min)^2 + (a Im(M conj G)/(|d| |G|))^2

    Args:
        chords: chords of the fixes.
        nodes_s: (n,) times at which psi is known [s].
        psi_rad: (n,) psi, the integrated yaw rate, at the times ``nodes_s`` [rad].
        sigma_min_rad: minimum standard deviation of a course [rad].
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
    """Return the offset between the yaw and psi, and its rate, estimated by a Kalman filter from the courses.

    The Kalman filter has F = [[1, dt], [0, 1]], Q = dt diag(walk^2, (1e-5)^2) and H = [1, -lag]. The innovation is
    wrapped to (-pi, pi]. A course is rejected if its innovation exceeds five standard deviations. If the next course is
    also an outlier but agrees with the rejected course, the filter restarts from the next course.

    Args:
        courses: measured offsets, at least one.
        rate: rate of the offset before the first course, and its standard deviation [rad/s].
        walk_rad_per_sqrt_s: random walk of the yaw [rad/sqrt(s)].
    """
    states: list[tuple[float, FloatArray, FloatArray]] = []
    dropped, prior = -1, np.array(rate)
    for k, (t, lag, z, sigma) in enumerate(zip(*(part.tolist() for part in courses), strict=True)):
        if not states:
            states.append((t, *_initial_state(z, lag, sigma, prior[0], prior[1] ** 2)))
            continue
        since, x, P = states[-1]
        F = np.array([[1.0, t - since], [0.0, 1.0]])
        x, P = F @ x, F @ P @ F.T + (t - since) * np.diag([walk_rad_per_sqrt_s**2, YAW_BIAS_WALK**2])
        H = np.array([1.0, -lag])
        innovation, S = float(wrap_angle(z - H @ x)), float(H @ P @ H) + sigma**2
        if innovation**2 <= CONTRADICTION_SIGMAS**2 * S:
            K = P @ H / S
            states.append((t, x + K * innovation, P - np.outer(K, K) * S))
        elif dropped == k - 1 and _agree(courses, k - 1, k):  # two consecutive outliers that agree
            states.append((t, *_initial_state(z, lag, sigma, x[1], P[1, 1])))
        else:
            dropped = k
    return Drift(*(np.array(part) for part in zip(*states, strict=True)))


def rate_at_rest(t_s: FloatArray, rate_radps: FloatArray, rest_s: float, walk: float) -> tuple[float, float]:
    """Return the rate of the offset and its standard deviation [rad/s], from the mean yaw rate of the gyro at rest.

    If the vehicle is not at rest at the start, the rate is 0 and its standard deviation is 0.01 rad/s.
    """
    rows = t_s <= rest_s
    if rest_s < REST_S or not rows.any():
        return 0.0, TURN_ON_RADPS
    return -float(rate_radps[rows].mean()), float(np.hypot(walk / np.sqrt(rest_s), YAW_BIAS_WALK * np.sqrt(rest_s)))


def offsets_at(drift: Drift, t_s: FloatArray, walk: float) -> tuple[FloatArray, FloatArray]:
    """Return the yaw offset at the times ``t_s`` (n,) and its standard deviation, predicted from the latest course.

    Before the first course, the offset is extrapolated backwards from the first course.
    """
    latest = np.maximum(np.searchsorted(drift.t_s, t_s, side="right") - 1, 0)
    since_s, x, P = t_s - drift.t_s[latest], drift.x[latest], drift.P[latest]
    variance = P[:, 0, 0] + 2 * since_s * P[:, 0, 1] + since_s**2 * P[:, 1, 1] + np.abs(since_s) * walk**2
    return x[:, 0] + since_s * x[:, 1], np.sqrt(variance)


def _initial_state(z: float, lag: float, sigma: float, rate: float, variance: float) -> tuple[FloatArray, FloatArray]:
    """Return the initial offset and rate (2,) and their covariance, from the first course z = offset - lag * rate."""
    P = np.array([[sigma**2 + lag**2 * variance, lag * variance], [lag * variance, variance]])
    return np.array([z + lag * rate, rate]), P


def _agree(courses: Courses, first: int, second: int) -> bool:
    difference = wrap_angle(courses.offset_rad[second] - courses.offset_rad[first])
    return bool(abs(difference) <= CONTRADICTION_SIGMAS * np.hypot(courses.sigma_rad[first], courses.sigma_rad[second]))


UNKNOWN_RAD = np.pi / np.sqrt(3.0)
"""Standard deviation of an unknown yaw, which is uniformly distributed [rad]."""


class Yaw(NamedTuple):
    """Estimated yaw at the times of the IMU samples.

    Attributes:
        rad: (n,) yaw in (-pi, pi] [rad].
        sigma_rad: (n,) standard deviation of the yaw, as estimated by the yaw filter [rad].
    """

    rad: FloatArray
    sigma_rad: FloatArray


def yaw_rate(gyro_radps: FloatArray, roll_rad: FloatArray, pitch_rad: FloatArray) -> FloatArray:
    """Return the yaw rate (w_y sin(roll) + w_z cos(roll))/cos(pitch) (n,) [rad/s].

    The yaw rate is singular at a pitch of 90 degrees.
    """
    across = gyro_radps[:, 1] * np.sin(roll_rad) + gyro_radps[:, 2] * np.cos(roll_rad)
    return np.asarray(across / np.cos(pitch_rad))


def estimate_yaw(
    imu: Imu,
    roll_rad: FloatArray,
    pitch_rad: FloatArray,
    source: Heading | Track | None,
    walk_rad_per_sqrt_s: float,
    course_sigma_min_rad: float = 0.0,
) -> Yaw:
    """Return the yaw and its standard deviation at the times of the IMU samples.

    The function integrates the yaw rate to psi(t). The filter estimates the offset yaw - psi, which changes only when a
    heading is processed. Each heading is processed at the time of its stamp, which may lie between two IMU samples. The
    yaw at sample k depends only on headings up to t_k. Before the first heading, the yaw is the first heading minus the
    integrated yaw rate. A track gives courses instead of headings (see `courses_of`). If ``source`` is None, the yaw
    starts at zero with the standard deviation `UNKNOWN_RAD`.

    Args:
        imu: n samples; each gyro sample is the mean rate over the interval that ends at its stamp.
        roll_rad: (n,) roll at the stamps [rad].
        pitch_rad: (n,) pitch at the stamps [rad].
        source: at least one heading, or the track of the fixes, or None.
        walk_rad_per_sqrt_s: random walk of the yaw [rad/sqrt(s)].
        course_sigma_min_rad: minimum standard deviation of a course of the track [rad].
    """
    t_s, dt_s, rate_radps = imu.t_s, imu.intervals_s, yaw_rate(imu.gyro_radps, roll_rad, pitch_rad)
    psi = np.cumsum(dt_s * rate_radps)
    if source is None:
        return Yaw(wrap_angle(psi), np.full(len(psi), UNKNOWN_RAD))
    # Linear interpolation between the nodes is exact, because the rate is constant within a sample.
    nodes_s = np.concatenate(([t_s[0] - dt_s[0]], t_s))
    nodes_rad = np.concatenate(([0.0], psi))
    if isinstance(source, Track):
        courses = courses_of(source.chords, nodes_s, nodes_rad, course_sigma_min_rad)
        at_rest = rate_at_rest(t_s, rate_radps, source.rest_s, walk_rad_per_sqrt_s)
        drift = filter_drift(courses, at_rest, walk_rad_per_sqrt_s)
        offset, sigma = offsets_at(drift, t_s, walk_rad_per_sqrt_s)
        return Yaw(wrap_angle(psi + offset), sigma)
    offsets, variances = filter_offset(source, np.interp(source.t_s, nodes_s, nodes_rad), walk_rad_per_sqrt_s)
    latest = np.maximum(np.searchsorted(source.t_s, t_s, side="right") - 1, 0)
    since_s = np.abs(t_s - source.t_s[latest])
    return Yaw(wrap_angle(psi + offsets[latest]), np.sqrt(variances[latest] + since_s * walk_rad_per_sqrt_s**2))


def filter_offset(headings: Heading, psi_rad: FloatArray, walk_rad_per_sqrt_s: float) -> tuple[FloatArray, FloatArray]:
    """Return the offset yaw - psi (m,) after each heading, and the variance of the offset (m,).

    A Kalman filter with one state is initialised with the first heading and its variance and processes each heading z::

        P += (time since the previous heading) walk^2;  innovation = wrap(z - psi - offset)
        K = P/(P + sigma^2);  offset += K innovation;  P = (1 - K) P
    """
    offsets, variances = np.empty((2, len(headings.t_s)))
    offsets[0] = offset = float(headings.yaw_rad[0] - psi_rad[0])
    variances[0] = P = float(headings.sigma_rad[0] ** 2)
    walked = np.diff(headings.t_s) * walk_rad_per_sqrt_s**2
    steps = walked.tolist(), (headings.yaw_rad - psi_rad)[1:].tolist(), (headings.sigma_rad[1:] ** 2).tolist()
    for k, (walk, measured, variance) in enumerate(zip(*steps, strict=True), start=1):
        P += walk
        K = P / (P + variance)
        offset += K * (math.pi - (math.pi - (measured - offset)) % (2.0 * math.pi))  # like `wrap_angle`, for a float
        P *= 1 - K
        offsets[k], variances[k] = offset, P
    return offsets, variances


# Selection of the headings, courses or fixes that the yaw filter uses.

YAW_SOURCES = ("auto", *HEADING_SOURCES, "track", "gyro_only")


def select_headings(
    recording: Recording, source: str, min_speed_mps: float, sigma_min_rad: float
) -> Heading | Track | None:
    """Return the headings or the track for a ``source`` from `YAW_SOURCES`, or None for gyro_only.

    The source ``auto`` selects the first available source: measured headings, the course of an ENU velocity that
    exceeds the minimum speed at least once, or the track of the fixes if it has at least one chord. If no source is
    available, ``auto`` returns None. The source ``auto`` ignores a velocity in the body frame, because a velocity in
    the body frame has no course over ground.

    Raises:
        RecordingError: the recording does not have the requested source.
    """
    measured = recording.heading
    if source == "gyro_only":
        return None
    if measured is not None and len(measured.t_s) and source in ("auto", measured.source):
        return measured
    if source == "course":
        return _course(recording, min_speed_mps, sigma_min_rad)
    if source == "track":
        return required_track(recording)
    if source != "auto":
        raise RecordingError(
            f"{recording.name} has no {source.replace('_', '-')} heading{_instead(measured)}; use yaw_source=course,"
            " track, gyro_only or auto."
        )
    if recording.velocity is not None and recording.velocity.frame == "enu":
        courses = course_headings(recording.velocity, min_speed_mps, sigma_min_rad)
        if len(courses.t_s):
            return courses
    return track_in(recording)


def track_in(recording: Recording, least_m: float = MIN_CHORD_M) -> Track | None:
    """Return the track of the fixes during the time of the IMU samples, or None if the track has no chord."""
    imu = recording.inertial
    chords = chords_of(recording.position, imu.t_s[0], imu.t_s[-1], least_m)
    return Track(chords, recording.static_start_s) if len(chords.end_s) else None


def required_track(recording: Recording, least_m: float = MIN_CHORD_M) -> Track:
    """Return the track of the fixes during the time of the IMU samples.

    Raises:
        RecordingError: the track has no chord.
    """
    if (track := track_in(recording, least_m)) is None:
        raise RecordingError(
            f"{recording.name}: no course can be computed from the fixes. A course needs two fixes within"
            f" {MAX_CHORD_S:g} s whose distance is at least {least_m:g} m and large compared with their sigmas. Use"
            " another yaw_source."
        )
    return track


def course_headings(velocity: Velocity, min_speed_mps: float, sigma_min_rad: float) -> Heading:
    """Return the courses of all ENU velocities whose horizontal speed exceeds the minimum speed.

    The yaw is atan2(v_n, v_e). The standard deviation of the yaw is max(sigma_v/speed, sigma_min), where sigma_v^2 is
    n' R_v n and n is the normal of the course. The vehicle is assumed to drive forwards. In reverse, the course differs
    from the yaw by 180 degrees.
    """
    east, north = velocity.mps[:, 0], velocity.mps[:, 1]
    speed = np.hypot(east, north)
    usable = np.isfinite(speed) & (speed > min_speed_mps)
    across = np.column_stack([-north, east])[usable] / speed[usable, None]
    covariance = velocity.covariance_m2ps2[usable, :2, :2]
    sigma_v: FloatArray = np.sqrt(np.einsum("ki,kij,kj->k", across, covariance, across))
    sigma = np.maximum(sigma_v / speed[usable], sigma_min_rad)
    return Heading(velocity.t_s[usable], np.arctan2(north, east)[usable], sigma)


def _instead(measured: Heading | None) -> str:
    return "" if measured is None or not len(measured.t_s) else f" (the source of its headings is {measured.source})"


def _course(recording: Recording, min_speed_mps: float, sigma_min_rad: float) -> Heading:
    velocity = recording.velocity
    if velocity is None or velocity.frame != "enu":
        reason = "it has no velocity" if velocity is None else f"its velocity is in the {velocity.frame} frame"
        raise RecordingError(
            f"{recording.name} has no course over ground, because {reason}{_instead(recording.heading)}; use"
            " yaw_source=gyro_only or yaw_source=auto."
        )
    courses = course_headings(velocity, min_speed_mps, sigma_min_rad)
    if not len(courses.t_s):
        raise RecordingError(
            f"{recording.name} is never faster than {min_speed_mps} m/s, so it has no course;"
            " decrease course_min_speed_mps or use yaw_source=gyro_only."
        )
    return courses


# Notes for recordings whose yaw is not measured.

YAW_UNKNOWN = (
    "nothing measures the yaw: the recording has no heading, no sufficiently fast velocity over ground, and no two"
    f" fixes within {MAX_CHORD_S:g} s whose distance is large compared with their sigmas. Yaw starts at 0 (east), so"
    " the acceleration may have any direction. A heading, a velocity in ENU, or fixes of a faster drive are needed."
)
YAW_TRACKED = (
    "yaw comes from the track of the fixes, because the recording has neither headings nor velocities over ground; it"
    " depends on the errors of the fixes."
)
YAW_COARSE = (
    "yaw is hardly observable: it comes only from the track of the fixes, whose courses have sigmas from"
    f" {FINE_RAD:g} to {COARSE_RAD:g} rad, because the vehicle is slow and the fixes are noisy."
)


def yaw_remarks(recording: Recording, source: str, min_speed_mps: float, sigma_min_rad: float) -> tuple[str, ...]:
    """Return a note for the result table if the yaw is unknown or comes from the track of the fixes.

    The result is empty if the recording has no fixes or no IMU, or if ``source`` is neither auto nor track.
    """
    if source not in ("auto", "track") or recording.position is None or recording.imu is None:
        return ()
    selected = select_headings(recording, source, min_speed_mps, sigma_min_rad)
    if selected is None:
        return (YAW_UNKNOWN,)
    if not isinstance(selected, Track):
        return ()
    return (YAW_COARSE,) if is_coarse(selected) else (YAW_TRACKED,)


def is_coarse(track: Track) -> bool:
    """Return True if the median standard deviation of the courses of a track is larger than `FINE_RAD`."""
    return bool(np.median(track.chords.sigma_rad) > FINE_RAD)
