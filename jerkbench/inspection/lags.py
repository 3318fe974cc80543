"""The lags between the streams of a recording."""

from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inspection.peaks import LEAST_ROWS, Peak, best_lag, correlation_of, largest_lag_s
from jerkbench.recording import Imu, Position, Recording, Reference, Velocity

MARGIN_S = 1.0
"""At the ends of the positions a spline's slope is poor."""

FAST_MPS = 1.0
"""Below, the speed's change is mostly noise."""

SHORTEST_STEP_S, LONGEST_STEP_S = 0.2, 1.5
"""Over shorter steps a speed's change is mostly noise; over longer ones little is left to compare."""


@dataclass(frozen=True)
class Lag:
    """The lag of one stream behind another.

    Attributes:
        stream: what is late: "position", "velocity, horizontal", "velocity, up", "speed", "imu".
        against: what it was compared with.
        lag_s: how old its values are at their stamps; the stamps less this are right. NaN where it cannot be told.
        correlation: of the two at that lag.
        within_s: half the width of the lags that fit hardly worse (95 %).
        edge_s: the largest or smallest lag that was tried, where it fits best: the true one may be beyond; else NaN.
        best_s: the lag that fits best, also where it cannot be told; NaN at an edge.
    """

    stream: str
    against: str
    lag_s: float
    correlation: float
    within_s: float
    edge_s: float = float("nan")
    best_s: float = float("nan")


def estimated_lags(recording: Recording) -> list[Lag]:
    """Return the lag of each stream that can be compared: of position, velocity and IMU, up to 3 s.

    Position, with r(t) the cubic spline through the places of a reference that is not the fixes themselves::

        lag = argmax over tau of corr(r(t_i+1 - tau) - r(t_i - tau), p_i+1 - p_i)

    Velocity, with s(t) the cubic spline through the positions; horizontal and up apart::

        lag = argmax over tau of corr(s'(t_i - tau), v_i)

    A speed is compared with |s'| likewise. IMU, with v the velocity at its stamps less its own lag, or, without
    velocities, the reference's, or else that from place to place::

        lag = argmax over tau of corr(int over (t_i + tau, t_i+1 + tau) of f_x dt, |v_i+1| - |v_i|)

    where it is faster than 1 m/s: what accelerates a vehicle forwards is felt on its x axis, whatever its yaw; a slope
    adds a part that changes slowly. The accelerometer must be in the body's axes.
    """
    position, velocity = recording.position, recording.velocity
    lags = []
    if position is not None and (truth := _places(recording.reference, position)) is not None:
        lags.append(_lag("position", "the reference", _position_lag(position, *truth)))
    of_velocity = []
    if position is not None and velocity is not None and len(_known(position.t_s, position.enu_m)[0]) > LEAST_ROWS:
        of_velocity = _velocity_lags(position, velocity)
    speed = _speeds(recording, of_velocity)
    if speed is None or recording.imu is None:
        return [*lags, *of_velocity]
    against, t_s, speed_mps = speed
    return [*lags, *of_velocity, _lag("imu", against, _imu_lag(recording.imu, t_s, speed_mps))]


def _lag(stream: str, against: str, peak: Peak) -> Lag:
    return Lag(stream, against, peak.lag_s, peak.correlation, peak.within_s, peak.edge_s, peak.best_s)


def _known(t_s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    rows = np.isfinite(values).all(axis=1)
    return t_s[rows], values[rows]


def _places(reference: Reference, position: Position) -> tuple[FloatArray, FloatArray] | None:
    """The places (k, 3) of a reference that is not the fixes, with their times; None without enough of them."""
    if reference.enu_m is None:
        return None
    if np.array_equal(reference.t_s, position.t_s) and np.array_equal(reference.enu_m, position.enu_m, equal_nan=True):
        return None
    t_s, enu_m = _known(reference.t_s, reference.enu_m)
    return (t_s, enu_m) if len(t_s) > LEAST_ROWS else None


def _position_lag(position: Position, t_s: FloatArray, enu_m: FloatArray) -> Peak:
    """Compare the way from fix to fix with the reference's over the same time."""
    from scipy.interpolate import CubicSpline

    largest_s = largest_lag_s(t_s[-1] - t_s[0])
    fixes = np.column_stack([position.enu_m[:, :2], np.zeros(len(position.t_s))])
    fix_s, places = _known(position.t_s, fixes)
    way = CubicSpline(t_s, enu_m[:, :2])
    begin, end = fix_s[:-1], fix_s[1:]
    use = (end - begin < LONGEST_STEP_S) & (begin > t_s[0] + largest_s) & (end < t_s[-1] - largest_s)
    begin, end, moved = begin[use], end[use], np.diff(places[:, :2], axis=0)[use]
    return best_lag(
        lambda tau_s: correlation_of(way(end - tau_s) - way(begin - tau_s), moved), int(use.sum()), largest_s
    )


def _velocity_lags(position: Position, velocity: Velocity) -> list[Lag]:
    parts = {"velocity, horizontal": (0, 1), "velocity, up": (2,)} if velocity.frame == "enu" else {"speed": (0,)}
    return [
        _lag(name, "differentiated position", _velocity_lag(position, velocity, axes)) for name, axes in parts.items()
    ]


def _velocity_lag(position: Position, velocity: Velocity, axes: tuple[int, ...]) -> Peak:
    """Compare the velocity with the slope of the positions on ``axes``; a speed with the slope's length."""
    from scipy.interpolate import CubicSpline

    fix_s, enu_m = _known(position.t_s, position.enu_m)
    slope = CubicSpline(fix_s, enu_m).derivative()
    largest_s = largest_lag_s(fix_s[-1] - fix_s[0])
    begin_s, end_s = fix_s[[0, -1]] + np.array([1, -1]) * (MARGIN_S + largest_s)
    rows = np.isfinite(velocity.mps[:, axes]).all(axis=1) & (velocity.t_s > begin_s) & (velocity.t_s < end_s)
    t_s, mps = velocity.t_s[rows], velocity.mps[rows][:, axes]

    def correlation(tau_s: float) -> float:
        shifted = slope(t_s - tau_s)
        return correlation_of(shifted[:, axes] if velocity.frame == "enu" else np.linalg.norm(shifted, axis=1), mps)

    return best_lag(correlation, len(t_s), largest_s)


def _speeds(recording: Recording, lags: list[Lag]) -> tuple[str, FloatArray, FloatArray] | None:
    """Return a name, the true times (m,) and the speeds (m,) over ground to compare the IMU with, or None."""
    velocity, reference, position = recording.velocity, recording.reference, recording.position
    if velocity is not None:
        axes = (0, 1) if velocity.frame == "enu" else (0,)
        t_s, mps = _known(velocity.t_s, velocity.mps[:, axes])
        late_s = lags[0].lag_s if lags and np.isfinite(lags[0].lag_s) else 0.0
        against = "differentiated velocity" if velocity.frame == "enu" else "differentiated speed of the wheel"
        return against, t_s - late_s, np.linalg.norm(mps, axis=1)
    if reference.velocity_mps is not None:
        t_s, mps = _known(reference.t_s, reference.velocity_mps[:, :2])
        return "the reference's differentiated velocity", t_s, np.linalg.norm(mps, axis=1)
    if reference.enu_m is not None:
        return "the reference's places, differentiated twice", *_from_place_to_place(reference.t_s, reference.enu_m)
    if position is not None:
        return "positions, differentiated twice", *_from_place_to_place(position.t_s, position.enu_m)
    return None


def _from_place_to_place(t_s: FloatArray, enu_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Times half-way between places, and the mean speed there."""
    t_s, places = _known(t_s, enu_m[:, :2])
    every = _every(t_s)
    t_s, places = t_s[::every], places[::every]
    return 0.5 * (t_s[1:] + t_s[:-1]), np.linalg.norm(np.diff(places, axis=0), axis=1) / np.diff(t_s)


def _imu_lag(imu: Imu, t_s: FloatArray, speed_mps: FloatArray) -> Peak:
    """Compare the speed's changes with the integral of the forward force over the same time."""
    every, largest_s = _every(t_s), largest_lag_s(imu.t_s[-1] - imu.t_s[0])
    t_s, speed_mps = t_s[::every], speed_mps[::every]
    gained = np.concatenate([[0.0], np.cumsum(imu.accel_mps2[1:, 0] * np.diff(imu.t_s))])
    begin, end, change = t_s[:-1], t_s[1:], np.diff(speed_mps)
    use = (np.minimum(speed_mps[:-1], speed_mps[1:]) > FAST_MPS) & (end - begin < LONGEST_STEP_S)
    use &= (begin > imu.t_s[0] + largest_s) & (end < imu.t_s[-1] - largest_s)
    begin, end, change = begin[use], end[use], change[use]

    def correlation(tau_s: float) -> float:
        felt = np.interp(end + tau_s, imu.t_s, gained) - np.interp(begin + tau_s, imu.t_s, gained)
        return correlation_of(felt, change)

    return best_lag(correlation, len(change), largest_s)


def _every(t_s: FloatArray) -> int:
    """Every so many rows the steps are long enough for a change to show."""
    return max(1, round(SHORTEST_STEP_S / float(np.median(np.diff(t_s))))) if len(t_s) > 1 else 1
