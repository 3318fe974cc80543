"""An IMU and a track, both as means over the same short windows."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.recording import Imu, Position, Recording

LENGTHS_S = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Noise asks for long windows, a winding track for short ones: each evidence takes those that say most."""

SLOWEST_MPS = 0.5
"""Below, a track of fixes has no course."""

STEEPEST_RAD = 1.5
"""A course that changes by more within a window may as well have turned the other way, or be noise."""

LEAST_WINDOWS = 20


@dataclass(frozen=True, eq=False)
class Windows:
    """What the track says, and what the IMU says of the same.

    Attributes:
        course_change_rad: (n,) of the track within each window, to the left.
        plane_mps2: (n, 2) acceleration of the track, forward and left.
        turn_rad: (n, 3) the gyro's integral.
        force_mps2: (n, 3) the mean specific force.
    """

    course_change_rad: FloatArray
    plane_mps2: FloatArray
    turn_rad: FloatArray
    force_mps2: FloatArray

    def __len__(self) -> int:
        """Return how many windows there are."""
        return len(self.course_change_rad)


def window_means(t_s: FloatArray, values: FloatArray, edges_s: FloatArray) -> FloatArray:
    """Return (n, k) the means of values (m, k) between n + 1 edges; each value is the mean up to its stamp."""
    first_s = t_s[0] - np.median(np.diff(t_s))
    ends_s = np.concatenate([[first_s], t_s])
    total = np.vstack([np.zeros(values.shape[1]), np.cumsum(values * np.diff(ends_s)[:, None], axis=0)])
    at_edges = np.column_stack([np.interp(edges_s, ends_s, column) for column in total.T])
    return np.asarray(np.diff(at_edges, axis=0) / np.diff(edges_s)[:, None], dtype=np.float64)


def track_windows(recording: Recording, length_s: float, late_s: float = 0.0) -> Windows | None:
    """Return the windows of a recording with an IMU and fixes; None with fewer than 20 in motion.

    With v_i the mean velocity from edge to edge of the fixes, taken linearly, chi_i its course and s_i its size, a
    window goes from the middle of one interval T to that of the next::

        course change = chi_i+1 - chi_i,    forward = (s_i+1 - s_i)/T,    left = (s_i+1 + s_i)/2 (chi_i+1 - chi_i)/T

    Args:
        recording: IMU and position are used.
        length_s: T.
        late_s: the IMU's stamps less this are right.
    """
    imu, position = recording.imu, recording.position
    if imu is None or position is None:
        return None
    edges_s, velocity_mps = _mean_velocity(imu, position, length_s)
    if len(velocity_mps) <= LEAST_WINDOWS:
        return None
    speed_mps = np.linalg.norm(velocity_mps, axis=1)
    course_rad = np.arctan2(velocity_mps[:, 1], velocity_mps[:, 0])
    change_rad = np.asarray((np.diff(course_rad) + np.pi) % (2 * np.pi) - np.pi, dtype=np.float64)
    left = 0.5 * (speed_mps[1:] + speed_mps[:-1]) * change_rad / length_s
    middles_s = 0.5 * (edges_s[1:] + edges_s[:-1]) + late_s
    both = window_means(imu.t_s, np.hstack([imu.gyro_radps, imu.accel_mps2]), middles_s)
    use = (np.minimum(speed_mps[1:], speed_mps[:-1]) > SLOWEST_MPS) & (np.abs(change_rad) < STEEPEST_RAD)
    use &= (middles_s[:-1] > imu.t_s[0]) & (middles_s[1:] < imu.t_s[-1])
    if use.sum() < LEAST_WINDOWS:
        return None
    plane = np.column_stack([np.diff(speed_mps) / length_s, left])
    return Windows(change_rad[use], plane[use], both[use, :3] * length_s, both[use, 3:])


def _mean_velocity(imu: Imu, position: Position, length_s: float) -> tuple[FloatArray, FloatArray]:
    """Edges (n + 1,) and the mean horizontal velocity (n, 2) between them; none where fixes are further apart."""
    known = np.isfinite(position.enu_m[:, :2]).all(axis=1)
    t_s, places = position.t_s[known], position.enu_m[known, :2]
    if len(t_s) <= LEAST_WINDOWS or np.median(np.diff(t_s)) > length_s * 1.01:
        return np.empty(0), np.empty((0, 2))
    edges_s = np.arange(max(t_s[0], imu.t_s[0]), min(t_s[-1], imu.t_s[-1]), length_s)
    at_edges = np.column_stack([np.interp(edges_s, t_s, column) for column in places.T])
    return edges_s, np.diff(at_edges, axis=0) / length_s
