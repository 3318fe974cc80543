"""Yaw at the start from where the fixes go, for recordings that have neither headings nor a velocity over ground."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import RecordingError
from jerkbench.recording import Position, Recording


def yaw_from_track(recording: Recording, start_s: float, least_m: float) -> float:
    """Return the yaw [rad] at ``start_s``: the first course between fixes, less the gyro's yaw since the start.

    The course is that from the last fix that is at least ``least_m`` behind, to the first fix for which there is one
    within three seconds; it is true half way between the two. The gyro's mean over the rest is taken off, and the
    vehicle is taken to be level and to drive forwards.

    Raises:
        RecordingError: no two fixes within three seconds are that far apart.
    """
    pair = _first_apart(recording.position, start_s, least_m) if recording.position is not None else None
    if pair is None:
        raise RecordingError(
            f"{recording.name} has no two fixes within 3 s that are {least_m:g} m apart, so they show no course; lower"
            " track_least_m or take yaw_source attitude."
        )
    (east, north), middle_s = pair
    return float(np.arctan2(north, east) - _turned_rad(recording, start_s, middle_s))


def _first_apart(fixes: Position, start_s: float, least_m: float) -> tuple[tuple[float, float], float] | None:
    """The way east and north between the first two fixes that are apart, and the time half way."""
    for last in range(len(fixes.t_s)):
        near = (fixes.t_s >= max(start_s, fixes.t_s[last] - 3.0)) & (fixes.t_s < fixes.t_s[last])
        way = fixes.enu_m[last, :2] - fixes.enu_m[:, :2]
        behind = np.flatnonzero(near & (np.hypot(way[:, 0], way[:, 1]) >= least_m))
        if behind.size:
            east, north = way[behind[-1]].tolist()
            return (east, north), float(0.5 * (fixes.t_s[behind[-1]] + fixes.t_s[last]))
    return None


def _turned_rad(recording: Recording, start_s: float, end_s: float) -> float:
    """Yaw that the vertical gyro measures between two times."""
    imu = recording.imu
    rate: FloatArray = imu.gyro_radps[:, 2]
    rest = imu.t_s < recording.static_start_s
    bias = rate[rest].mean() if rest.any() else 0.0
    within = (imu.t_s > start_s) & (imu.t_s <= end_s)
    return float(((rate - bias) * np.diff(imu.t_s, prepend=imu.t_s[0]))[within].sum())
