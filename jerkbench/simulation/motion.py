"""The path of the robot: passes and headland turns, or a given path through waypoints; smooth steps, sums of sines."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray

# Sums of sines, with their derivatives.


def harmonics(
    x: FloatArray, frequency: FloatArray, sine: FloatArray, cosine: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return y_c = sum_w a_cw sin(k_w x) + b_cw cos(k_w x), and dy_c/dx, both (n, c).

    Args:
        x: (n,) time or distance.
        frequency: (w,) k, in radians per unit of x.
        sine: (c, w) a.
        cosine: (c, w) b.
    """
    phase = np.multiply.outer(x, frequency)
    sines, cosines = np.sin(phase), np.cos(phase)
    value = _weigh(sines, sine) + _weigh(cosines, cosine)
    return value, _weigh(cosines, frequency * sine) - _weigh(sines, frequency * cosine)


def _weigh(waves: FloatArray, weights: FloatArray) -> FloatArray:
    # einsum, not @: so small a product only loses by the threads of BLAS, most of all when a sweep fills the cores
    return np.asarray(np.einsum("nw,cw->nc", waves, weights))


# Smooth steps, so that speed and height can be differentiated twice.


def smoothstep(u: FloatArray) -> FloatArray:
    """S(u) = 10 u^3 - 15 u^4 + 6 u^5 from 0 to 1 over 0 <= u <= 1; its first two derivatives vanish at both ends."""
    w = np.clip(u, 0.0, 1.0)
    return np.asarray(w**3 * (10.0 + w * (6.0 * w - 15.0)))


def smoothstep_rate(u: FloatArray) -> FloatArray:
    """dS/du = 30 u^2 (1 - u)^2."""
    w = np.clip(u, 0.0, 1.0)
    return np.asarray(30.0 * (w * (1.0 - w)) ** 2)


def smoothstep_area(u: FloatArray) -> FloatArray:
    """Integral of S from 0 to u: u^4 (u^2 - 3 u + 5/2) up to u = 1, and u - 1/2 beyond."""
    w = np.clip(u, 0.0, 1.0)
    return np.asarray((w * w) ** 2 * (w * (w - 3.0) + 2.5) + np.maximum(u - 1.0, 0.0))


@dataclass(frozen=True)
class Path:
    """Boustrophedon: stand, ramp up, then straight passes and turns of 180 degrees to alternating sides.

    The speed is a sum of smoothsteps S, one for each change; in a turn of length T that starts at t_0 the yaw rate is

        (pi/T) (1 - cos(2 pi (t - t_0)/T)),  left at first, then right, left, ...

    A pass ends and the next one begins with the change between the two speeds, so that a turn is driven at
    ``turn_speed_mps`` from its first to its last moment.

    Attributes:
        stand_s: how long it stands at the start.
        ramp_s: how long it takes to reach the speed of a pass.
        pass_s: length of a pass, speed changes included.
        turn_s: length T of a turn.
        speed_mps: horizontal speed on a pass.
        turn_speed_mps: horizontal speed in a turn.
        speed_change_s: how long it takes from one speed to the other.
        heading_rad: first heading, from east towards north.
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
        """Times before ``until_s`` at which a turn begins."""
        first, period = self.stand_s + self.ramp_s + self.pass_s, self.pass_s + self.turn_s
        return first + period * np.arange(max(0, int(np.ceil((until_s - first) / period))), dtype=float)

    def speed_mps_at(self, t_s: FloatArray) -> FloatArray:
        """Horizontal speed (n,) at increasing times (n,)."""
        changes = self._speed_changes(t_s)
        return np.asarray(sum(change * smoothstep((t_s - start) / length) for start, length, change in changes))

    def distance_m_at(self, t_s: FloatArray) -> FloatArray:
        """Horizontal distance (n,) driven since the start."""
        changes = self._speed_changes(t_s)
        return np.asarray(
            sum(change * length * smoothstep_area((t_s - start) / length) for start, length, change in changes)
        )

    def yaw_rad_at(self, t_s: FloatArray) -> FloatArray:
        """Yaw (n,), not wrapped; each turn adds +-(pi w - sin(2 pi w)/2) with w = (t - t_0)/T in [0, 1]."""
        yaw = np.full_like(t_s, self.heading_rad)
        for number, start in enumerate(self.turn_starts_s(t_s[-1])):
            w = np.clip((t_s - start) / self.turn_s, 0.0, 1.0)
            yaw += (-1) ** number * (np.pi * w - 0.5 * np.sin(2.0 * np.pi * w))
        return yaw

    def _speed_changes(self, t_s: FloatArray) -> list[tuple[float, float, float]]:
        """Start, length and size of each change of speed."""
        changes = [(self.stand_s, self.ramp_s, self.speed_mps)]
        slower = self.turn_speed_mps - self.speed_mps
        for start in self.turn_starts_s(t_s[-1] + self.speed_change_s):
            changes.append((float(start) - self.speed_change_s, self.speed_change_s, slower))
            changes.append((float(start) + self.turn_s, self.speed_change_s, -slower))
        return changes


# A given path: through waypoints at a speed, or through a table of times and positions.

FINE_M = 0.01
"""Step in which the length of a path is summed up."""

Curve = Callable[[FloatArray, int], FloatArray]
"""From a parameter (n,) and the order of the derivative to (n, 3)."""


class Way(NamedTuple):
    """A motion at n times: along a smooth path, or what vibration adds to one.

    Attributes:
        enu_m: (n, 3) position.
        velocity_mps: (n, 3) its derivative.
        euler_rad: (n, 3) roll (0 along a path), pitch and yaw, which is not wrapped.
    """

    enu_m: FloatArray
    velocity_mps: FloatArray
    euler_rad: FloatArray


class Drive(NamedTuple):
    """The speed over a way of a given length: stand, ramp up, go on, ramp down to a stop at its end.

    speed(t) = v [S((t - stand)/ramp) - S((t - stop)/ramp)], S the quintic smoothstep, and the stop begins such that
    the integral is the length: stop = stand + length/v.

    Attributes:
        length_m: of the way, at least speed times ramp.
        stand_s: standing at the start.
        ramp_s: of both ramps.
        speed_mps: v.
    """

    length_m: float
    stand_s: float
    ramp_s: float
    speed_mps: float

    @property
    def duration_s(self) -> float:
        """Time until it stands again."""
        return self.stand_s + self.length_m / self.speed_mps + self.ramp_s

    def speed_mps_at(self, t_s: FloatArray) -> FloatArray:
        """Return the speed (n,)."""
        up, down = self._progress(t_s)
        return np.asarray(self.speed_mps * (smoothstep(up) - smoothstep(down)))

    def distance_m_at(self, t_s: FloatArray) -> FloatArray:
        """Return the distance driven (n,)."""
        up, down = self._progress(t_s)
        return np.asarray(self.speed_mps * self.ramp_s * (smoothstep_area(up) - smoothstep_area(down)))

    def _progress(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        up = (t_s - self.stand_s) / self.ramp_s
        return up, up - self.length_m / self.speed_mps / self.ramp_s


class WaypointPath:
    """A cubic spline through waypoints (k, 3), k >= 2, over the sum of the straight distances between them."""

    def __init__(self, waypoints_m: FloatArray) -> None:
        """Lay the spline, and measure its length."""
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
        """Return the motion at the times (n,); the velocity is the position's derivative to the last digit."""
        distance = np.clip(drive.distance_m_at(t_s), 0.0, self.length_m)
        u = self._parameter(distance)
        tangent = self._curve(u, 1)
        rate = self._parameter(distance, 1) * drive.speed_mps_at(t_s)
        return Way(self._curve(u, 0), rate[:, None] * tangent, along(tangent, np.ones(len(t_s), dtype=bool)))


def table_curve(table_t_s: FloatArray, enu_m: FloatArray, sigma_m: float) -> Curve:
    """Return the cubic spline over time through the places (k, 3), or near them.

    With ``sigma_m`` > 0 each axis is a smoothing spline whose mean squared distance from the places is sigma^2 at most.
    """
    from scipy.interpolate import CubicSpline, UnivariateSpline

    if sigma_m == 0:
        return CubicSpline(table_t_s, enu_m)  # type: ignore[no-any-return]  # scipy ships no types
    allowed = len(table_t_s) * sigma_m**2
    axes = [UnivariateSpline(table_t_s, axis, k=3, s=allowed) for axis in enu_m.T]
    return lambda t_s, order: np.column_stack([axis(t_s, order) for axis in axes])


def curve_way(t_s: FloatArray, curve: Curve, min_speed_mps: float) -> tuple[Way, BoolArray]:
    """Return the motion at the times (n,), and where it is faster than the minimum, level, so that it has a course."""
    velocity = curve(t_s, 1)
    moving = np.hypot(velocity[:, 0], velocity[:, 1]) > min_speed_mps
    return Way(curve(t_s, 0), velocity, along(velocity, moving)), moving


def along(direction: FloatArray, known: BoolArray) -> FloatArray:
    """Roll, pitch and yaw (n, 3) of a vehicle that points along ``direction`` (n, 3) and does not roll.

    pitch = -atan(up/level), positive nose down; yaw = atan2(north, east). Where it is not ``known`` (n,) the angles go
    straight from the last that is to the next one; zero if none is.
    """
    if not known.any():
        return np.zeros_like(direction)
    east, north, up = direction[known].T
    yaw, pitch = np.unwrap(np.arctan2(north, east)), -np.arctan2(up, np.hypot(east, north))
    rows, at = np.arange(len(direction)), np.flatnonzero(known)
    return np.column_stack([np.zeros(len(rows)), np.interp(rows, at, pitch), np.interp(rows, at, yaw)])
