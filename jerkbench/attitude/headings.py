"""Where the yaw filter gets its headings: the dual antenna, the course of the velocity, or nowhere."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.recording import Heading, Recording, Velocity

YAW_SOURCES = ("auto", "dual_antenna", "course", "gyro_only")


def select_headings(recording: Recording, source: str, min_speed_mps: float, sigma_min_rad: float) -> Heading | None:
    """Return the headings of ``source``, one of `YAW_SOURCES`; None for gyro_only.

    ``auto`` takes the dual antenna when the recording has headings, else the course when there is an ENU velocity
    that is fast enough at least once, else none. A body-frame velocity holds no course: auto passes it over.

    Raises:
        RecordingError: the recording lacks the source that was asked for.
    """
    if source == "gyro_only":
        return None
    if source == "dual_antenna":
        return _dual_antenna(recording)
    if source == "course":
        return _course(recording, min_speed_mps, sigma_min_rad)
    if recording.heading is not None and len(recording.heading.t_s):
        return recording.heading
    if recording.velocity is None or recording.velocity.frame != "enu":
        return None
    courses = course_headings(recording.velocity, min_speed_mps, sigma_min_rad)
    return courses if len(courses.t_s) else None


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


def _dual_antenna(recording: Recording) -> Heading:
    if recording.heading is None or not len(recording.heading.t_s):
        raise RecordingError(
            f"{recording.name} has no dual-antenna heading; take yaw_source course, gyro_only or auto."
        )
    return recording.heading


def _course(recording: Recording, min_speed_mps: float, sigma_min_rad: float) -> Heading:
    velocity = recording.velocity
    if velocity is None:
        raise RecordingError(f"{recording.name} has no velocity, so no course; take yaw_source gyro_only or auto.")
    if velocity.frame != "enu":
        raise RecordingError(
            f"{recording.name} has its velocity in the {velocity.frame} frame, which tells no course over ground;"
            " take yaw_source dual_antenna, gyro_only or auto."
        )
    courses = course_headings(velocity, min_speed_mps, sigma_min_rad)
    if not len(courses.t_s):
        raise RecordingError(
            f"{recording.name} is never faster than {min_speed_mps} m/s, so it has no course;"
            " lower course_min_speed_mps or take yaw_source gyro_only."
        )
    return courses
