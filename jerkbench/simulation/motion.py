"""Paths of a simulated vehicle: parallel passes with headland turns, or a path given by waypoints or a table."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray

# Sums of sines and cosines, and the derivatives of these sums.


def harmonics(
    x: FloatArray, frequency: FloatArray, sine: FloatArray, cosine: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the sums y_c = sum_w a_cw sin(k_w x) + b_cw cos(k_w x) and their derivatives dy_c/dx, both (n, c).

    Args:
        x: (n,) times or distances at which the sums are evaluated.
        frequency: (w,) frequencies k in radians per unit of x.
        sine: (c, w) coefficients a of the sines.
        cosine: (c, w) coefficients b of the cosines.
    """
    phase = np.multiply.outer(x, frequency)
    sines, cosines = np.sin(phase), np.cos(phase)
    value = _weigh(sines, sine) + _weigh(cosines, cosine)
    return value, _weigh(cosines, frequency * sine) - _weigh(sines, frequency * cosine)


def _weigh(waves: FloatArray, weights: FloatArray) -> FloatArray:
    # not @, because the threads of BLAS slow down small matrix products in a parallel sweep
    return np.asarray(np.einsum("nw,cw->nc", waves, weights))


# Smooth steps, which make speed and height twice differentiable.


def smoothstep(u: FloatArray) -> FloatArray:
    """Return S(u) = 10 u^3 - 15 u^4 + 6 u^5, a step from 0 to 1 whose first two derivatives vanish at both ends."""
    w = np.clip(u, 0.0, 1.0)
    return np.asarray(w**3 * (10.0 + w * (6.0 * w - 15.0)))


def smoothstep_rate(u: FloatArray) -> FloatArray:
    """Return the derivative dS/du = 30 u^2 (1 - u)^2 of the smooth step S."""
    w = np.clip(u, 0.0, 1.0)
    return np.asarray(30.0 * (w * (1.0 - w)) ** 2)


def smoothstep_area(u: FloatArray) -> FloatArray:
    """Return the integral of the smooth step S from 0 to u, which is u^4 (u^2 - 3 u + 5/2) for 0 <= u <= 1."""
    w = np.clip(u, 0.0, 1.0)
    return np.asarray((w * w) ** 2 * (w * (w - 3.0) + 2.5) + np.maximum(u - 1.0, 0.0))


@dataclass(frozen=True)
class Path:
    """Path of a field robot: a rest, an acceleration, then straight passes and turns of 180 deg to alternating sides.

    The speed is a sum of smooth steps S, one for each change of the speed. In a turn that starts at the time t_0 and
    has the duration T, the yaw rate is a raised cosine. The first turn is to the left, and the following turns are to
    alternating sides::

        (pi/T) (1 - cos(2 pi (t - t_0)/T))

    The speed changes only during passes (at their start and end). Therefore, the speed is ``turn_speed_mps`` during the
    complete turn.

    Attributes:
        stand_s: duration of the rest at the start [s].
        ramp_s: duration of the acceleration from rest to the speed of a pass [s].
        pass_s: duration of a pass, including the speed changes [s].
        turn_s: duration T of a turn of 180 degrees [s].
        speed_mps: horizontal speed on a pass [m/s].
        turn_speed_mps: horizontal speed in a turn [m/s].
        speed_change_s: duration of each change from the speed of a pass to the speed of a turn, or back [s].
        heading_rad: initial heading, measured from east towards north [rad].
    """

    stand_s: float
    ramp_s: float
    pass_s: float
    turn_s: float
    speed_mps: float
    turn_speed_mps: float
    speed_change_s: float
    heading_rad: float

    def turn_starts_s(self, until_s: float) -> FloatArray:
        """Return the start times of the turns that start before ``until_s``."""
        first, period = self.stand_s + self.ramp_s + self.pass_s, self.pass_s + self.turn_s
        return first + period * np.arange(max(0, int(np.ceil((until_s - first) / period))), dtype=float)

    def speed_mps_at(self, t_s: FloatArray) -> FloatArray:
        """Return the horizontal speed (n,) at increasing times (n,)."""
        changes = self._speed_changes(t_s)
        return np.asarray(sum(change * smoothstep((t_s - start) / length) for start, length, change in changes))

    def distance_m_at(self, t_s: FloatArray) -> FloatArray:
        """Return the horizontal distance (n,) from the start at increasing times (n,)."""
        changes = self._speed_changes(t_s)
        return np.asarray(
            sum(change * length * smoothstep_area((t_s - start) / length) for start, length, change in changes)
        )

    def yaw_rad_at(self, t_s: FloatArray) -> FloatArray:
        """Return the unwrapped yaw (n,). Each turn adds +-(pi w - sin(2 pi w)/2) with w = (t - t_0)/T in [0, 1]."""
        yaw = np.full_like(t_s, self.heading_rad)
        for number, start in enumerate(self.turn_starts_s(t_s[-1])):
            w = np.clip((t_s - start) / self.turn_s, 0.0, 1.0)
            yaw += (-1) ** number * (np.pi * w - 0.5 * np.sin(2.0 * np.pi * w))
        return yaw

    def _speed_changes(self, t_s: FloatArray) -> list[tuple[float, float, float]]:
        """Return the start time [s], the duration [s] and the size [m/s] of each change of the speed."""
        changes = [(self.stand_s, self.ramp_s, self.speed_mps)]
        slower = self.turn_speed_mps - self.speed_mps
        for start in self.turn_starts_s(t_s[-1] + self.speed_change_s):
            changes.append((float(start) - self.speed_change_s, self.speed_change_s, slower))
            changes.append((float(start) + self.turn_s, self.speed_change_s, -slower))
        return changes


# Paths that the user defines by waypoints and a speed, or by a table of times and positions.

FINE_M = 0.01
"""Step of the numerical integration of the length of a path [m]."""

Curve = Callable[[FloatArray, int], FloatArray]
"""A function of a parameter (n,) and the order of the derivative that returns points or derivatives (n, 3)."""


class Way(NamedTuple):
    """Motion at n times: the motion along a path, or the motion of a vibration.

    Attributes:
        enu_m: (n, 3) position [m].
        velocity_mps: (n, 3) velocity, the time derivative of ``enu_m`` [m/s].
        euler_rad: (n, 3) roll, pitch and unwrapped yaw [rad]. The roll of a motion along a path is 0.
    """

    enu_m: FloatArray
    velocity_mps: FloatArray
    euler_rad: FloatArray


class Drive(NamedTuple):
    """Speed along a path of a given length: a rest, an acceleration, a constant speed, and a final deceleration.

    The speed is v [S((t - rest)/ramp) - S((t - stop)/ramp)] with the quintic smooth step S. The deceleration starts at
    the time stop = rest + length/v, so that the driven distance is the length of the path.

    Attributes:
        length_m: length of the path, which must be at least ``speed_mps`` times ``ramp_s`` [m].
        rest_s: duration of the rest at the start [s].
        ramp_s: duration of the acceleration and of the deceleration [s].
        speed_mps: constant speed v between the acceleration and the deceleration [m/s].
    """

    length_m: float
    rest_s: float
    ramp_s: float
    speed_mps: float

    @property
    def duration_s(self) -> float:
        """Time until the end of the deceleration [s]."""
        return self.rest_s + self.length_m / self.speed_mps + self.ramp_s

    def speed_mps_at(self, t_s: FloatArray) -> FloatArray:
        """Return the speed (n,) [m/s] at the times ``t_s`` (n,)."""
        up, down = self._progress(t_s)
        return np.asarray(self.speed_mps * (smoothstep(up) - smoothstep(down)))

    def distance_m_at(self, t_s: FloatArray) -> FloatArray:
        """Return the distance (n,) [m] from the start at the times ``t_s`` (n,)."""
        up, down = self._progress(t_s)
        return np.asarray(self.speed_mps * self.ramp_s * (smoothstep_area(up) - smoothstep_area(down)))

    def _progress(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        up = (t_s - self.rest_s) / self.ramp_s
        return up, up - self.length_m / self.speed_mps / self.ramp_s


class WaypointPath:
    """A path along a cubic spline through at least two waypoints (k, 3).

    The spline parameter of a waypoint is the sum of the distances between all waypoints up to this waypoint.
    """

    def __init__(self, waypoints_m: FloatArray) -> None:
        """Compute the spline through the waypoints and the length of the path."""
        from scipy.interpolate import CubicSpline

        chords = np.linalg.norm(np.diff(waypoints_m, axis=0), axis=1)
        knots = np.concatenate([[0.0], np.cumsum(chords)])
        self._curve: Curve = CubicSpline(knots, waypoints_m)
        u = np.linspace(0.0, knots[-1], max(3, int(np.ceil(knots[-1] / FINE_M))))
        stretch = np.linalg.norm(self._curve(0.5 * (u[1:] + u[:-1]), 1), axis=1)
        lengths = np.concatenate([[0.0], np.cumsum(stretch * np.diff(u))])
        self.length_m = float(lengths[-1])
        self._parameter = CubicSpline(lengths, u)

    def driven(self, t_s: FloatArray, drive: Drive) -> Way:
        """Return the motion at the times (n,). The velocity is the exact derivative of the position."""
        distance = np.clip(drive.distance_m_at(t_s), 0.0, self.length_m)
        u = self._parameter(distance)
        tangent = self._curve(u, 1)
        rate = self._parameter(distance, 1) * drive.speed_mps_at(t_s)
        return Way(self._curve(u, 0), rate[:, None] * tangent, along(tangent, np.ones(len(t_s), dtype=bool)))


def table_curve(table_t_s: FloatArray, enu_m: FloatArray, sigma_m: float) -> Curve:
    """Return a cubic spline over time that interpolates or smooths the positions (k, 3) in a table.

    If ``sigma_m`` is 0, the spline interpolates the positions. If ``sigma_m`` is positive, the spline of each axis is a
    smoothing spline, whose mean squared distance from the positions is at most sigma^2.
    """
    from scipy.interpolate import CubicSpline, UnivariateSpline

    if sigma_m == 0:
        return CubicSpline(table_t_s, enu_m)  # type: ignore[no-any-return]  # scipy ships no types
    allowed = len(table_t_s) * sigma_m**2
    axes = [UnivariateSpline(table_t_s, axis, k=3, s=allowed) for axis in enu_m.T]
    return lambda t_s, order: np.column_stack([axis(t_s, order) for axis in axes])


def curve_way(t_s: FloatArray, curve: Curve, min_speed_mps: float) -> tuple[Way, BoolArray]:
    """Return the motion at the times (n,), and a mask (n,) of the times with a speed of more than ``min_speed_mps``."""
    velocity = curve(t_s, 1)
    moving = np.hypot(velocity[:, 0], velocity[:, 1]) > min_speed_mps
    return Way(curve(t_s, 0), velocity, along(velocity, moving)), moving


def along(direction: FloatArray, known: BoolArray) -> FloatArray:
    """Return roll, pitch and yaw (n, 3) of a vehicle that points along ``direction`` (n, 3), with a roll of 0.

    The pitch is -atan(up/horizontal), positive for nose down, and the yaw is atan2(north, east). ``known`` (n,) is
    False for rows with an unknown direction, whose angles are interpolated linearly. If no direction is known, all
    angles are 0.
    """
    if not known.any():
        return np.zeros_like(direction)
    east, north, up = direction[known].T
    yaw, pitch = np.unwrap(np.arctan2(north, east)), -np.arctan2(up, np.hypot(east, north))
    rows, at = np.arange(len(direction)), np.flatnonzero(known)
    return np.column_stack([np.zeros(len(rows)), np.interp(rows, at, pitch), np.interp(rows, at, yaw)])
