"""The source of the yaw filter: measured headings, the course of the velocity, the track of the fixes, or none."""

from collections.abc import Callable

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.attitude.chords import LEAST_M, LONGEST_S, chords_of
from jerkbench.attitude.track import Track, track_of
from jerkbench.errors import RecordingError
from jerkbench.recording import HEADING_SOURCES, Heading, Recording, Velocity

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
            f"{recording.name} has no {_name(source)} heading{_instead(measured)}; take yaw_source {_others(source)}."
        )
    if recording.velocity is not None and recording.velocity.frame == "enu":
        courses = course_headings(recording.velocity, min_speed_mps, sigma_min_rad)
        if len(courses.t_s):
            return courses
    return track_in(recording)


def track_in(recording: Recording, least_m: float = LEAST_M) -> Track | None:
    """Return the track of the fixes while the IMU runs; None where it shows no course."""
    imu = recording.inertial
    return track_of(recording, chords_of(recording.position, imu.t_s[0], imu.t_s[-1], least_m))


def required_track(recording: Recording, least_m: float = LEAST_M) -> Track:
    """Return the track of the fixes while the IMU runs.

    Raises:
        RecordingError: it shows no course.
    """
    track = track_in(recording, least_m)
    if track is None:
        raise RecordingError(
            f"{recording.name}: its fixes show no course, for within {LONGEST_S:g} s no two are far enough apart for"
            f" their sigmas (and {least_m:g} m); take another yaw_source."
        )
    return track


def require_headings(load: Callable[[], Recording], source: str, min_speed_mps: float, sigma_min_rad: float) -> None:
    """Check, before anything runs, that a source that was asked for is there; ``load`` gives the recording.

    Raises:
        RecordingError: it is not.
    """
    if source not in ("auto", "gyro_only"):
        select_headings(load(), source, min_speed_mps, sigma_min_rad)


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


def _name(source: str) -> str:
    return source.replace("_", "-")


def _instead(measured: Heading | None) -> str:
    return "" if measured is None or not len(measured.t_s) else f", its headings are of source {measured.source}"


def _others(source: str) -> str:
    return f"{', '.join(s for s in ('course', 'track', 'gyro_only') if s != source)} or auto"


def _course(recording: Recording, min_speed_mps: float, sigma_min_rad: float) -> Heading:
    velocity = recording.velocity
    if velocity is None:
        raise RecordingError(
            f"{recording.name} has no velocity, so no course{_instead(recording.heading)}; take yaw_source gyro_only or"
            " auto."
        )
    if velocity.frame != "enu":
        raise RecordingError(
            f"{recording.name} has its velocity in the {velocity.frame} frame, which tells no course over ground"
            f"{_instead(recording.heading)}; take yaw_source gyro_only or auto."
        )
    courses = course_headings(velocity, min_speed_mps, sigma_min_rad)
    if not len(courses.t_s):
        raise RecordingError(
            f"{recording.name} is never faster than {min_speed_mps} m/s, so it has no course;"
            " lower course_min_speed_mps or take yaw_source gyro_only."
        )
    return courses
