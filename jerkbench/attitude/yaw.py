"""The yaw filter: one state, the offset between yaw and the integrated yaw rate; and where its headings come from."""

import math
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.attitude.track import (
    COARSE_RAD,
    FINE_RAD,
    LEAST_CHORD_M,
    LONGEST_S,
    Track,
    chords_of,
    courses_of,
    filter_drift,
    offsets_at,
    rate_at_rest,
)
from jerkbench.errors import RecordingError
from jerkbench.geometry import wrap_angle
from jerkbench.recording import HEADING_SOURCES, Heading, Imu, Recording, Velocity

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
    take the place of headings, see `jerkbench.attitude.track`. Without either yaw starts at zero, and nobody knows it.

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


def track_in(recording: Recording, least_m: float = LEAST_CHORD_M) -> Track | None:
    """Return the track of the fixes while the IMU runs; None where it shows no course."""
    imu = recording.inertial
    chords = chords_of(recording.position, imu.t_s[0], imu.t_s[-1], least_m)
    return Track(chords, recording.static_start_s) if len(chords.end_s) else None


def required_track(recording: Recording, least_m: float = LEAST_CHORD_M) -> Track:
    """Return the track of the fixes while the IMU runs.

    Raises:
        RecordingError: it shows no course.
    """
    if (track := track_in(recording, least_m)) is None:
        raise RecordingError(
            f"{recording.name}: its fixes show no course, for within {LONGEST_S:g} s no two are far enough apart for"
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
    f"nothing shows yaw: no heading, no velocity over ground that is fast enough, and within {LONGEST_S:g} s no two"
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
