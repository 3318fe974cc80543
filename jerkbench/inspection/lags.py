"""The lags between the streams of a recording."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inspection.evidence import (
    correlation_of,
    mean_velocity,
    without_nan_rows,
)
from jerkbench.recording import Imu, Position, Recording, Reference, Velocity

NAN = float("nan")

LARGEST_S = 3.0
STEP_S = 0.02
"""The lags that are tried: every step from -largest to largest; between them a parabola."""

PART = 0.1
"""Of a short recording no larger part is tried as a lag: little would be left to compare."""

LEAST_ROWS = 20
LEAST_CORRELATION = 0.5
"""With fewer rows, or a weaker relation at the best lag, none is stated."""

ROWS_OF_A_DRAW = 10
"""So many rows are worth one of a white residual: what is left at the best lag follows itself."""

LIKELY = 3.84
"""Chi-square of one degree of freedom, 95 %."""

WORST_S = 0.1
"""A lag of which no more than this is known is none."""

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
        lag_s: how old its values are at their stamps; the stamps less this are right. NaN where it is not well known.
        correlation: of the two at the best lag; NaN with too few rows.
        within_s: half the width of the lags that fit hardly worse (95 %).
        edge_s: the largest or smallest lag that was tried, where it fits best: the true one may be beyond; else NaN.
        best_s: the lag that fits best, however badly; NaN at an edge.
        at_none: the correlation without any lag.
        sure: whether nothing else than late stamps explains it.
    """

    stream: str
    against: str
    lag_s: float = NAN
    correlation: float = NAN
    within_s: float = NAN
    edge_s: float = NAN
    best_s: float = NAN
    at_none: float = NAN
    sure: bool = True


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
    position, velocity, reference = recording.position, recording.velocity, recording.reference
    lags = []
    if position is not None and (truth := _places(reference, position)) is not None:
        lags.append(_position_lag(position, *truth))
    of_velocity = []
    if (
        position is not None
        and velocity is not None
        and len(without_nan_rows(position.t_s, position.enu_m)[0]) > LEAST_ROWS
    ):
        axes = {"velocity, horizontal": (0, 1), "velocity, up": (2,)} if velocity.frame == "enu" else {"speed": (0,)}
        of_velocity = [_velocity_lag(name, position, velocity, columns) for name, columns in axes.items()]
    speed = _speeds(recording, of_velocity)
    of_imu = [] if speed is None or recording.imu is None else [_imu_lag(recording.imu, *speed)]
    return [*lags, *of_velocity, *of_imu]


def best_lag(
    stream: str, against: str, correlation: Callable[[float], float], rows: int, largest_s: float = LARGEST_S
) -> Lag:
    """Return where ``correlation`` of a lag [s], over ``rows``, is largest up to ``largest_s``.

    A lag tau fits hardly worse than the best where (n/10) ln((1 - r(tau)^2)/(1 - r(best)^2)) < 3.84, r of n rows.
    """
    if rows < LEAST_ROWS:
        return Lag(stream, against)
    steps = round(largest_s / STEP_S)
    lags_s = np.asarray(np.arange(-steps, steps + 1) * STEP_S, dtype=np.float64)
    values = np.array([correlation(lag_s) for lag_s in lags_s])
    best = int(np.argmax(values))
    lag = Lag(stream, against, NAN, float(values[best]), _within(lags_s, values, rows), at_none=float(values[steps]))
    if best in (0, len(values) - 1):
        return replace(lag, edge_s=float(lags_s[best])) if lag.correlation >= LEAST_CORRELATION else lag
    lag = replace(lag, best_s=_refined(lags_s, values))
    is_known = lag.correlation >= LEAST_CORRELATION and lag.within_s <= WORST_S
    return replace(lag, lag_s=lag.best_s) if is_known else lag


def _refined(lags_s: FloatArray, values: FloatArray) -> float:
    """Return the top of the parabola through the best of evenly spaced lags and its neighbours, all of them inside."""
    best = int(np.argmax(values))
    before, peak, after = values[best - 1 : best + 2]
    bend = before - 2 * peak + after
    offset = 0.5 * (before - after) / bend if bend < 0 else 0.0
    return float(lags_s[best] + offset * (lags_s[1] - lags_s[0]))


def _within(lags_s: FloatArray, values: FloatArray, rows: int) -> float:
    """Return half the width of the lags that fit hardly worse than the best; at least half a step."""
    misfit = np.maximum(1.0 - values**2, 1e-12)
    likely = np.log(misfit / misfit[int(np.argmax(values))]) < LIKELY * ROWS_OF_A_DRAW / rows
    likely &= values > 0
    return float(0.5 * (np.ptp(lags_s[likely]) + lags_s[1] - lags_s[0])) if likely.any() else float(lags_s[-1])


def _largest_s(t_s: FloatArray) -> float:
    return float(np.clip(PART * (t_s[-1] - t_s[0]), 0.6, LARGEST_S))


def _places(reference: Reference, position: Position) -> tuple[FloatArray, FloatArray] | None:
    """The places (k, 3) of a reference that is not the fixes, with their times; None without enough of them."""
    if reference.enu_m is None:
        return None
    if np.array_equal(reference.t_s, position.t_s) and np.array_equal(reference.enu_m, position.enu_m, equal_nan=True):
        return None
    t_s, enu_m = without_nan_rows(reference.t_s, reference.enu_m)
    return (t_s, enu_m) if len(t_s) > LEAST_ROWS else None


def _position_lag(position: Position, t_s: FloatArray, enu_m: FloatArray) -> Lag:
    """Compare the way from fix to fix with the reference's over the same time."""
    from scipy.interpolate import CubicSpline

    largest_s, way = _largest_s(t_s), CubicSpline(t_s, enu_m[:, :2])
    fix_s, places = without_nan_rows(position.t_s, position.enu_m[:, :2])
    begin, end = fix_s[:-1], fix_s[1:]
    use = (end - begin < LONGEST_STEP_S) & (begin > t_s[0] + largest_s) & (end < t_s[-1] - largest_s)
    begin, end, moved = begin[use], end[use], np.diff(places, axis=0)[use]

    def correlation(tau_s: float) -> float:
        return correlation_of(way(end - tau_s) - way(begin - tau_s), moved)

    return best_lag("position", "the reference", correlation, len(moved), largest_s)


def _velocity_lag(name: str, position: Position, velocity: Velocity, axes: tuple[int, ...]) -> Lag:
    """Compare the velocity with the slope of the positions on ``axes``; a speed with the slope's length."""
    from scipy.interpolate import CubicSpline

    fix_s, enu_m = without_nan_rows(position.t_s, position.enu_m)
    slope, largest_s = CubicSpline(fix_s, enu_m).derivative(), _largest_s(fix_s)
    begin_s, end_s = fix_s[[0, -1]] + np.array([1, -1]) * (MARGIN_S + largest_s)
    t_s, mps = without_nan_rows(velocity.t_s, velocity.mps[:, axes])
    rows = (t_s > begin_s) & (t_s < end_s)
    t_s, mps = t_s[rows], mps[rows]

    def correlation(tau_s: float) -> float:
        shifted = slope(t_s - tau_s)
        return correlation_of(shifted[:, axes] if velocity.frame == "enu" else np.linalg.norm(shifted, axis=1), mps)

    return best_lag(name, "differentiated position", correlation, len(t_s), largest_s)


def _speeds(recording: Recording, lags: list[Lag]) -> tuple[str, FloatArray, FloatArray] | None:
    """Return a name, the true times (m,) and the speeds (m,) over ground to compare the IMU with, or None."""
    velocity, reference, position = recording.velocity, recording.reference, recording.position
    if velocity is not None:
        enu = velocity.frame == "enu"
        t_s, mps = without_nan_rows(velocity.t_s, velocity.mps[:, (0, 1) if enu else (0,)])
        late_s = lags[0].lag_s if lags and np.isfinite(lags[0].lag_s) else 0.0
        against = "differentiated velocity" if enu else "differentiated speed of the wheel"
        return against, t_s - late_s, np.linalg.norm(mps, axis=1)
    if reference.velocity_mps is not None:
        t_s, mps = without_nan_rows(reference.t_s, reference.velocity_mps[:, :2])
        return "the reference's differentiated velocity", t_s, np.linalg.norm(mps, axis=1)
    if reference.enu_m is not None:
        return "the reference's places, differentiated twice", *_from_place_to_place(reference.t_s, reference.enu_m)
    if position is not None:
        return "positions, differentiated twice", *_from_place_to_place(position.t_s, position.enu_m)
    return None


def _from_place_to_place(t_s: FloatArray, enu_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Times half-way between places, and the mean speed there."""
    t_s, places = without_nan_rows(t_s, enu_m[:, :2])
    every = _every(t_s)
    t_s, places = t_s[::every], places[::every]
    return 0.5 * (t_s[1:] + t_s[:-1]), np.linalg.norm(mean_velocity(t_s, places, t_s), axis=1)


def _imu_lag(imu: Imu, against: str, t_s: FloatArray, speed_mps: FloatArray) -> Lag:
    """Compare the speed's changes with the integral of the forward force over the same time."""
    every, largest_s = _every(t_s), _largest_s(imu.t_s)
    t_s, speed_mps = t_s[::every], speed_mps[::every]
    gained = np.concatenate([[0.0], np.cumsum(imu.accel_mps2[1:, 0] * np.diff(imu.t_s))])
    begin, end, change = t_s[:-1], t_s[1:], np.diff(speed_mps)
    use = (np.minimum(speed_mps[:-1], speed_mps[1:]) > FAST_MPS) & (end - begin < LONGEST_STEP_S)
    use &= (begin > imu.t_s[0] + largest_s) & (end < imu.t_s[-1] - largest_s)
    begin, end, change = begin[use], end[use], change[use]

    def correlation(tau_s: float) -> float:
        felt = np.interp(end + tau_s, imu.t_s, gained) - np.interp(begin + tau_s, imu.t_s, gained)
        return correlation_of(felt, change)

    return best_lag("imu", against, correlation, len(change), largest_s)


def _every(t_s: FloatArray) -> int:
    """Every so many rows the steps are long enough for a change to show."""
    return max(1, round(SHORTEST_STEP_S / float(np.median(np.diff(t_s))))) if len(t_s) > 1 else 1
