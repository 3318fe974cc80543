"""Headings from fix to fix, for a recording that has no other."""

from dataclasses import replace

import numpy as np

from jerkbench.errors import RecordingError
from jerkbench.recording import Heading, Position, Recording

SURE = 4.0
"""A step between fixes has to be so many of its own sigmas long, for a course to be Gaussian and not reversed."""


def with_courses(recording: Recording, over_s: float) -> Recording:
    """Return the recording with a heading every ``over_s`` seconds, and a note that says so.

    Raises:
        RecordingError: it has no positions, has headings already, or never moves far enough.
    """
    if recording.heading is not None or recording.position is None:
        obstacle = "has headings already" if recording.heading is not None else "has no positions"
        raise RecordingError(f"{recording.name} {obstacle}; leave course_over_s at 0.")
    heading = courses(recording.position, over_s)
    if not len(heading.t_s):
        raise RecordingError(
            f"{recording.name}: within {over_s:g} s no two fixes are further apart than {SURE:g} of their sigmas; make"
            " course_over_s longer."
        )
    note = (
        f"Headings are courses between fixes {over_s:g} s apart, placed in the middle: they look"
        f" {over_s / 2:g} s ahead, and share the fixes' errors."
    )
    return replace(recording, heading=heading, notes=(*recording.notes, note))


def courses(position: Position, over_s: float) -> Heading:
    """Return the direction between fixes that are ``over_s`` apart, one after the other without overlap."""
    usual = float(np.median(np.diff(position.t_s)))
    rows = np.arange(0, len(position.t_s), max(round(over_s / usual), 1))
    t_s = position.t_s[rows]
    step_m, duration_s = np.diff(position.enu_m[rows, :2], axis=0), np.diff(t_s)
    variance = np.diagonal(position.covariance_m2[rows], axis1=1, axis2=2)[:, :2].max(axis=1)
    sigma_m = np.sqrt(variance[1:] + variance[:-1])
    far_m = np.linalg.norm(step_m, axis=1)
    with np.errstate(invalid="ignore"):
        sure = (far_m > SURE * sigma_m) & (duration_s < 1.5 * over_s + usual)  # NaN and gaps are not sure
    middle_s = 0.5 * (t_s[1:] + t_s[:-1])[sure]
    yaw_rad = np.arctan2(step_m[sure, 1], step_m[sure, 0])
    return Heading(middle_s, yaw_rad, sigma_m[sure] / far_m[sure], "course")
