"""The source of a recording's yaw, in a line."""

import numpy as np

from jerkbench.attitude.tilt import Tilt
from jerkbench.attitude.track import Track
from jerkbench.attitude.yaw import COARSE, UNKNOWN, is_coarse, select_headings
from jerkbench.recording import Recording


def yaw_line(recording: Recording) -> str:
    """Say what the attitude filters take yaw from by themselves, or that nothing shows it."""
    tilt = Tilt()
    selected = select_headings(recording, tilt.yaw_source, tilt.course_min_speed_mps, tilt.course_sigma_min_rad)
    if selected is None and recording.position is None:
        return "yaw: nothing shows it; there is no heading, no velocity over ground that is fast enough, and no fix"
    if selected is None:
        return f"yaw: {UNKNOWN}"
    if isinstance(selected, Track):
        chords = selected.chords
        line = (
            f"yaw: from the track of the fixes, {len(chords.end_s)} courses, the first one known at"
            f" {chords.end_s[0]:.2f} s; sigma {np.median(chords.sigma_rad):.2g} rad (median)"
        )
        return f"{line}. {COARSE.capitalize()}" if is_coarse(selected) else line
    if selected is recording.heading:
        return f"yaw: from {len(selected.t_s)} headings of source {selected.source}"
    return f"yaw: from the course of {len(selected.t_s)} velocities above {tilt.course_min_speed_mps:g} m/s"
