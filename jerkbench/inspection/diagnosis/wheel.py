"""Checks of a wheel: its change of speed, the force in a bend, and the length of the way."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inspection.diagnosis.diagnosis import Diagnosis
from jerkbench.inspection.diagnosis.plane import EXCHANGED
from jerkbench.inspection.diagnosis.windows import LEAST_WINDOWS, SLOWEST_MPS, Windows, window_means
from jerkbench.recording import Recording

WAY_S = 5.0
"""Over shorter windows the noise of a fix is much of the way, over longer ones the bends are."""

WITHIN = 0.15
"""So far from 1 may the middle of way over way be where the axes are right: bends, slip, a wheel's scale."""

APART = 0.3
"""So far from 1 it has to be for the axes as they are."""


def wheel_speeds(recording: Recording) -> tuple[FloatArray, FloatArray] | None:
    """Return times (n,) and forward speeds (n,) of a wheel or along the body; None where there are too few."""
    velocity = recording.velocity
    if velocity is None or velocity.frame == "enu":
        return None
    known = np.isfinite(velocity.mps[:, 0])
    return (velocity.t_s[known], velocity.mps[known, 0]) if known.sum() > LEAST_WINDOWS else None


def wheel_windows(recording: Recording, length_s: float, late_s: float = 0.0) -> Windows | None:
    """Return what a wheel, the gyro's z axis and the accelerometer say of the same windows; None with fewer than 20.

    With s_i the mean speed over an interval T, a window goes from the middle of one to that of the next::

        forward = (s_i+1 - s_i)/T,    left = (s_i+1 + s_i)/2 w_z

    Args:
        recording: IMU and velocity are used.
        length_s: T.
        late_s: the IMU's stamps less this are right.
    """
    imu, wheel = recording.imu, wheel_speeds(recording)
    if imu is None or wheel is None or np.median(np.diff(wheel[0])) > length_s:
        return None
    t_s, mps = wheel
    edges_s = np.arange(max(t_s[0], imu.t_s[0]), min(t_s[-1], imu.t_s[-1]), length_s)
    if len(edges_s) <= LEAST_WINDOWS + 2:
        return None
    speed_mps = window_means(t_s, mps[:, None], edges_s)[:, 0]
    middles_s = 0.5 * (edges_s[1:] + edges_s[:-1]) + late_s
    both = window_means(imu.t_s, np.hstack([imu.gyro_radps, imu.accel_mps2]), middles_s)
    use = (middles_s[:-1] > imu.t_s[0]) & (middles_s[1:] < imu.t_s[-1])
    if use.sum() < LEAST_WINDOWS:
        return None
    left = 0.5 * (speed_mps[1:] + speed_mps[:-1]) * both[:, 2]
    plane = np.column_stack([np.diff(speed_mps) / length_s, left])
    turn_rad = both[:, :3] * length_s
    return Windows(turn_rad[use, 2], plane[use], turn_rad[use], both[use, 3:])


def exchanged_degrees(recording: Recording) -> list[Diagnosis]:
    """Return whether the way of the fixes has its length only with latitude and longitude exchanged.

    Read the wrong way round, a degree of latitude counts as one of longitude: east was cos(longitude) times north, and
    north east over cos(latitude), so that the length of a way depends on its direction::

        |way|^2 = (north' cos(latitude))^2 + (east'/cos(longitude))^2
    """
    position, origin, wheel = recording.position, recording.origin, wheel_speeds(recording)
    if position is None or origin is None or wheel is None:
        return []
    ways_m, driven_m = _ways(position.t_s, position.enu_m, *wheel)
    if len(driven_m) < LEAST_WINDOWS:
        return []
    as_given = _middle(ways_m, driven_m)
    cosines = abs(np.cos(np.radians(origin.latitude_deg))), abs(np.cos(np.radians(origin.longitude_deg)))
    mended = [_middle(ways_m * [1.0 / max(b, 0.01), a], driven_m) for a, b in (cosines, cosines[::-1])]
    best = min(mended, key=lambda ratio: abs(ratio - 1.0))
    if abs(as_given - 1.0) < APART or abs(best - 1.0) > WITHIN:
        return []
    return [
        Diagnosis(
            f"speed against fixes: {EXCHANGED}",
            f"the fixes go {as_given:.2f} times as far as the wheels, and {best:.2f} times with latitude and longitude"
            " exchanged",
            "Latitude and longitude are exchanged",
            "Exchange the first two of position_columns",
        )
    ]


def _ways(t_s: FloatArray, enu_m: FloatArray, wheel_s: FloatArray, mps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Ways (n, 2) of the fixes from edge to edge and their lengths (n,) by the wheel, where it drives."""
    known = np.isfinite(enu_m[:, :2]).all(axis=1)
    t_s, places = t_s[known], enu_m[known, :2]
    if len(t_s) <= LEAST_WINDOWS:
        return np.empty((0, 2)), np.empty(0)
    edges_s = np.arange(max(t_s[0], wheel_s[0]), min(t_s[-1], wheel_s[-1]), WAY_S)
    if len(edges_s) <= LEAST_WINDOWS:
        return np.empty((0, 2)), np.empty(0)
    at_edges = np.column_stack([np.interp(edges_s, t_s, column) for column in places.T])
    driven_m = WAY_S * window_means(wheel_s, np.abs(mps)[:, None], edges_s)[:, 0]
    use = driven_m > WAY_S * SLOWEST_MPS
    return np.diff(at_edges, axis=0)[use], driven_m[use]


def _middle(ways_m: FloatArray, driven_m: FloatArray) -> float:
    return float(np.median(np.linalg.norm(ways_m, axis=1) / driven_m))
