"""Sentences about a yaw that nothing measures."""

import numpy as np

from jerkbench.attitude.chords import COARSE_RAD, FINE_RAD, LONGEST_S
from jerkbench.attitude.headings import select_headings
from jerkbench.attitude.track import Track
from jerkbench.recording import Recording

UNKNOWN = (
    f"nothing shows yaw: no heading, no velocity over ground that is fast enough, and within {LONGEST_S:g} s no two"
    " fixes that are far enough apart for their sigmas. Yaw starts at 0 (east), and what the IMU adds may point"
    " anywhere; a heading, a velocity in ENU, or fixes of a longer or faster drive would show it."
)
TRACKED = (
    "yaw comes from the track of the fixes, for there is no heading and no velocity over ground; it shares the errors"
    " of the fixes."
)
COARSE = (
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
        return (UNKNOWN,)
    if not isinstance(selected, Track):
        return ()
    return (COARSE,) if is_coarse(selected) else (TRACKED,)


def is_coarse(track: Track) -> bool:
    """Whether most courses of a track are less sure than one likes them."""
    return bool(np.median(track.chords.sigma_rad) > FINE_RAD)
