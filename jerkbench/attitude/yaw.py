"""The yaw filter: from headings, the course of a velocity, or the track of the fixes with the gyro between them."""

import math
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray, IntArray
from jerkbench.errors import RecordingError
from jerkbench.geometry import wrap_angle
from jerkbench.recording import HEADING_SOURCES, Heading, Imu, Position, Recording, Velocity

# Pairs of fixes that are far enough apart to show a course; none overlaps another.

FINE_RAD = 0.05
"""A chord is as short as its course is this sure."""

COARSE_RAD = 0.15
"""Where none is for long, the surest does, if it is no less sure; fixes at rest then show none (a Rayleigh tail)."""

MAX_CHORD_S = 30.0
"""A chord lasts no longer: what the speed did on the way is not known."""

MIN_CHORD_M = 1.0
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


def chords_of(position: Position | None, begin_s: float, end_s: float, least_m: float = MIN_CHORD_M) -> Chords:
    """Return the chords of the fixes between two times.

    With d the way, n across it and R_i, R_j the covariances of both fixes, horizontal::

        sigma = sqrt(n' (R_i + R_j) n)/|d|

    A chord ends with the first fix for which there is one before, not before the end of the last chord, with a sigma
    of `FINE_RAD`; of these the latest. Where there was none for `MAX_CHORD_S`, the one with the least sigma is taken,
    if that is not above `COARSE_RAD`. Errors of successive chords correlate by at most -1/2, because they share a fix.
    To treat them as independent is conservative, because the shared fix cancels in a sum of chords.

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
    earliest = np.searchsorted(t_s, t_s - MAX_CHORD_S)
    for last in range(1, len(t_s)):
        first = max(free, int(earliest[last]))
        away = np.abs(places[last] - places[first:last])
        sigma = np.sqrt(variance[last] + variance[first:last]) / np.maximum(away, 1e-9)
        sigma[away < least_m] = np.inf
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


UNKNOWN_RAD = np.pi / np.sqrt(3.0)
"""One sigma of a yaw of which nothing is known: any direction is as likely."""


class Yaw(NamedTuple):
    """Yaw at the IMU's stamps.

    Attributes:
        rad: (n,) in (-pi, pi].
        sigma_rad: (n,) one standard deviation, as the filter sees it.
    """

    rad: FloatArray
    sigma_rad: FloatArray


def yaw_rate(gyro_radps: FloatArray, roll_rad: FloatArray, pitch_rad: FloatArray) -> FloatArray:
    """Rate of yaw (n,) [rad/s]: (w_y sin(roll) + w_z cos(roll))/cos(pitch). Singular at a pitch of 90 degrees."""
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
    """Return yaw at the IMU's stamps.

    psi(t) is the integral of the yaw rate. Yaw adds to it exactly, so the filter on yaw is a filter on the offset
    yaw - psi, which changes at headings only; each stands at its own time, inside a sample where need be. Sample k
    uses headings up to t_k; before the first one, the first one less the integrated rate. The courses of a track
    take the place of headings, see `jerkbench.attitude.yaw`. Without either yaw starts at zero, and nobody knows it.

    Args:
        imu: the gyro is the mean over the interval that ends at each stamp.
        roll_rad: (n,) at the stamps.
        pitch_rad: (n,) likewise.
        source: headings, at least one; the track of the fixes; or None.
        walk_rad_per_sqrt_s: random walk of yaw.
        course_sigma_min_rad: least standard deviation of a course of the track.
    """
    t_s, dt_s, rate_radps = imu.t_s, imu.intervals_s, yaw_rate(imu.gyro_radps, roll_rad, pitch_rad)
    psi = np.cumsum(dt_s * rate_radps)
    if source is None:
        return Yaw(wrap_angle(psi), np.full(len(psi), UNKNOWN_RAD))
    # Linear between the nodes is exact: the rate is constant within a sample.
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
    """Return the offset yaw - psi (m,) after each heading, and its variance (m,).

    P0 = variance of the first heading;  P += (time since the last) walk^2;  innovation = wrap(z - psi - offset);
    K = P/(P + sigma^2);  offset += K innovation;  P = (1 - K) P.
    """
    offsets, variances = np.empty((2, len(headings.t_s)))
    offsets[0] = offset = float(headings.yaw_rad[0] - psi_rad[0])
    variances[0] = P = float(headings.sigma_rad[0] ** 2)
    walked = np.diff(headings.t_s) * walk_rad_per_sqrt_s**2
    steps = walked.tolist(), (headings.yaw_rad - psi_rad)[1:].tolist(), (headings.sigma_rad[1:] ** 2).tolist()
    for k, (walk, measured, variance) in enumerate(zip(*steps, strict=True), start=1):
        P += walk
        K = P / (P + variance)
        offset += K * (math.pi - (math.pi - (measured - offset)) % (2.0 * math.pi))  # `wrap_angle` of a number
        P *= 1 - K
        offsets[k], variances[k] = offset, P
    return offsets, variances


# The source of the yaw filter: measured headings, the course of the velocity, the track of the
# fixes, or none.

YAW_SOURCES = ("auto", *HEADING_SOURCES, "track", "gyro_only")


def select_headings(
    recording: Recording, source: str, min_speed_mps: float, sigma_min_rad: float
) -> Heading | Track | None:
    """Return what ``source`` stands for, one of `YAW_SOURCES`; None for gyro_only.

    ``auto`` takes the headings that the recording has, whatever measured them, else the course when there is an ENU
    velocity that is fast enough at least once, else the track of the fixes where it shows a course at least once, else
    none. A velocity along the body's axes holds no course over ground: auto passes it over.

    Raises:
        RecordingError: the recording lacks the source that was asked for.
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
            f"{recording.name} has no {source.replace('_', '-')} heading{_instead(measured)}; take yaw_source course,"
            " track, gyro_only or auto."
        )
    if recording.velocity is not None and recording.velocity.frame == "enu":
        courses = course_headings(recording.velocity, min_speed_mps, sigma_min_rad)
        if len(courses.t_s):
            return courses
    return track_in(recording)


def track_in(recording: Recording, least_m: float = MIN_CHORD_M) -> Track | None:
    """Return the track of the fixes while the IMU runs; None where it shows no course."""
    imu = recording.inertial
    chords = chords_of(recording.position, imu.t_s[0], imu.t_s[-1], least_m)
    return Track(chords, recording.static_start_s) if len(chords.end_s) else None


def required_track(recording: Recording, least_m: float = MIN_CHORD_M) -> Track:
    """Return the track of the fixes while the IMU runs.

    Raises:
        RecordingError: it shows no course.
    """
    if (track := track_in(recording, least_m)) is None:
        raise RecordingError(
            f"{recording.name}: its fixes show no course, for within {MAX_CHORD_S:g} s no two are far enough apart for"
            f" their sigmas (and {least_m:g} m); take another yaw_source."
        )
    return track


def course_headings(velocity: Velocity, min_speed_mps: float, sigma_min_rad: float) -> Heading:
    """Return the course of each horizontal ENU velocity above the minimal speed.

    yaw = atan2(v_n, v_e);  sigma = max(sigma_v/speed, sigma_min), sigma_v^2 = n' R_v n with n across the course.
    It takes the vehicle to drive forwards: in reverse the course is half a turn off.
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
    return "" if measured is None or not len(measured.t_s) else f", its headings are of source {measured.source}"


def _course(recording: Recording, min_speed_mps: float, sigma_min_rad: float) -> Heading:
    velocity = recording.velocity
    if velocity is None or velocity.frame != "enu":
        lack = "has no velocity, so no course"
        if velocity is not None:
            lack = f"has its velocity in the {velocity.frame} frame, which tells no course over ground"
        other = _instead(recording.heading)
        raise RecordingError(f"{recording.name} {lack}{other}; take yaw_source gyro_only or auto.")
    courses = course_headings(velocity, min_speed_mps, sigma_min_rad)
    if not len(courses.t_s):
        raise RecordingError(
            f"{recording.name} is never faster than {min_speed_mps} m/s, so it has no course;"
            " lower course_min_speed_mps or take yaw_source gyro_only."
        )
    return courses


# Sentences about a yaw that nothing measures.

YAW_UNKNOWN = (
    f"nothing shows yaw: no heading, no velocity over ground that is fast enough, and within {MAX_CHORD_S:g} s no two"
    " fixes that are far enough apart for their sigmas. Yaw starts at 0 (east), and what the IMU adds may point"
    " anywhere; a heading, a velocity in ENU, or fixes of a longer or faster drive would show it."
)
YAW_TRACKED = (
    "yaw comes from the track of the fixes, for there is no heading and no velocity over ground; it shares the errors"
    " of the fixes."
)
YAW_COARSE = (
    "yaw is hardly observable: it comes from the track of the fixes alone, whose courses have sigmas from"
    f" {FINE_RAD:g} to {COARSE_RAD:g} rad, for the vehicle is slow and the fixes are noisy."
)


def yaw_remarks(recording: Recording, source: str, min_speed_mps: float, sigma_min_rad: float) -> tuple[str, ...]:
    """Return what a reader has to know of the yaw that ``source``, one of `YAW_SOURCES`, gives; often nothing.

    A recording without fixes is there for its attitude alone, one without an IMU has none, and one whose yaw is asked
    for from the gyro alone gets what was asked for: none of them is remarked on.
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
    """Whether most courses of a track are less sure than one likes them."""
    return bool(np.median(track.chords.sigma_rad) > FINE_RAD)
