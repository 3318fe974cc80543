"""How late the streams of a recording are against its positions."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.recording import Imu, Position, Recording, Velocity

LARGEST_S = 0.6
STEP_S = 0.02
"""The lags that are tried: every step from -largest to largest; between them a parabola."""

MARGIN_S = 1.0
"""At the ends of the positions a spline's slope is poor."""

FAST_MPS = 1.0
"""Below, the speed's change is mostly noise."""

SHORTEST_STEP_S, LONGEST_STEP_S = 0.2, 1.5
"""Over shorter steps a speed's change is mostly noise; over longer ones little is left to compare."""

LEAST_ROWS = 20
LEAST_CORRELATION = 0.5
"""With fewer rows, or a weaker relation at the best lag, none is stated."""

ROWS_OF_A_DRAW = 10
"""So many rows are worth one of a white residual: what is left at the best lag follows itself."""

LIKELY = 3.84
"""Chi-square of one degree of freedom, 95 %."""

WORST_S = 0.1
"""A lag of which no more than this is known is none."""


@dataclass(frozen=True)
class Lag:
    """How late one stream is.

    Attributes:
        stream: what is late: "velocity, horizontal", "velocity, up", "speed", "imu".
        against: what it was compared with.
        lag_s: how old its values are at their stamps; the stamps less this are right. NaN where it cannot be told.
        correlation: of the two at that lag.
        within_s: half the width of the lags that fit hardly worse (95 %).
    """

    stream: str
    against: str
    lag_s: float
    correlation: float
    within_s: float


def estimated_lags(recording: Recording) -> list[Lag]:
    """Return the lag of each stream that can be compared: of the velocity first, then of the IMU.

    Velocity, with s(t) the cubic spline through the positions; horizontal and up apart::

        lag = argmax over tau of corr(s'(t_i - tau), v_i)

    A speed is compared with |s'| likewise. IMU, with v the velocity at its stamps less its own lag::

        lag = argmax over tau of corr(int over (t_i + tau, t_i+1 + tau) of f_x dt, |v_i+1| - |v_i|)

    where it is faster than 1 m/s: what accelerates a vehicle forwards is felt on its x axis, whatever its yaw; a slope
    adds a part that changes slowly. The accelerometer must be in the body's axes.
    """
    position, velocity = recording.position, recording.velocity
    if velocity is None:
        return []
    known = 0 if position is None else int(np.isfinite(position.enu_m).all(axis=1).sum())
    lags = _velocity_lags(position, velocity) if position is not None and known > LEAST_ROWS else []
    against = "differentiated velocity" if velocity.frame == "enu" else "differentiated speed of the wheel"
    return [*lags, Lag("imu", against, *_imu_lag(recording.imu, *_speeds(velocity, lags)))]


def _velocity_lags(position: Position, velocity: Velocity) -> list[Lag]:
    parts = {"velocity, horizontal": (0, 1), "velocity, up": (2,)} if velocity.frame == "enu" else {"speed": (0,)}
    return [
        Lag(name, "differentiated position", *_velocity_lag(position, velocity, axes)) for name, axes in parts.items()
    ]


def _velocity_lag(position: Position, velocity: Velocity, axes: tuple[int, ...]) -> tuple[float, float, float]:
    """Compare the velocity with the slope of the positions on ``axes``; a speed with the slope's length."""
    from scipy.interpolate import CubicSpline

    known = np.isfinite(position.enu_m).all(axis=1)
    slope = CubicSpline(position.t_s[known], position.enu_m[known]).derivative()
    begin_s, end_s = position.t_s[known][[0, -1]] + np.array([1, -1]) * (MARGIN_S + LARGEST_S)
    rows = np.isfinite(velocity.mps[:, axes]).all(axis=1) & (velocity.t_s > begin_s) & (velocity.t_s < end_s)
    t_s, mps = velocity.t_s[rows], velocity.mps[rows][:, axes]

    def correlation(tau_s: float) -> float:
        there = slope(t_s - tau_s)
        return _correlation(there[:, axes] if velocity.frame == "enu" else np.linalg.norm(there, axis=1), mps)

    return _peak(correlation, len(t_s))


def _speeds(velocity: Velocity, lags: list[Lag]) -> tuple[FloatArray, FloatArray]:
    """Times when they were true (m,), and speeds (m,) over ground."""
    axes = (0, 1) if velocity.frame == "enu" else (0,)
    rows = np.isfinite(velocity.mps[:, axes]).all(axis=1)
    late_s = lags[0].lag_s if lags and np.isfinite(lags[0].lag_s) else 0.0
    return velocity.t_s[rows] - late_s, np.linalg.norm(velocity.mps[rows][:, axes], axis=1)


def _imu_lag(imu: Imu, t_s: FloatArray, speed_mps: FloatArray) -> tuple[float, float, float]:
    """Compare the speed's changes with the integral of the forward force over the same time."""
    t_s, speed_mps = _spaced(t_s, speed_mps)
    gained = np.concatenate([[0.0], np.cumsum(imu.accel_mps2[1:, 0] * np.diff(imu.t_s))])
    begin, end, change = t_s[:-1], t_s[1:], np.diff(speed_mps)
    use = (np.minimum(speed_mps[:-1], speed_mps[1:]) > FAST_MPS) & (end - begin < LONGEST_STEP_S)
    use &= (begin > imu.t_s[0] + LARGEST_S) & (end < imu.t_s[-1] - LARGEST_S)
    begin, end, change = begin[use], end[use], change[use]

    def correlation(tau_s: float) -> float:
        felt = np.interp(end + tau_s, imu.t_s, gained) - np.interp(begin + tau_s, imu.t_s, gained)
        return _correlation(felt, change)

    return _peak(correlation, len(change))


def _spaced(t_s: FloatArray, speed_mps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Every so many rows that the steps are long enough for a change to show."""
    every = max(1, round(SHORTEST_STEP_S / float(np.median(np.diff(t_s))))) if len(t_s) > 1 else 1
    return t_s[::every], speed_mps[::every]


def _peak(correlation: Callable[[float], float], rows: int) -> tuple[float, float, float]:
    """Return the lag of the largest correlation, refined by a parabola, that, and how well the lag is known.

    A lag tau fits hardly worse than the best where (n/10) ln((1 - r(tau)^2)/(1 - r(best)^2)) < 3.84, r of n rows.
    NaN where nothing can be told.
    """
    if rows < LEAST_ROWS:
        return float("nan"), float("nan"), float("nan")
    steps = round(LARGEST_S / STEP_S)
    lags_s = np.asarray(np.arange(-steps, steps + 1) * STEP_S, dtype=np.float64)
    values = np.array([correlation(lag_s) for lag_s in lags_s])
    best = int(np.argmax(values))
    within_s = _within(lags_s, values, rows)
    if not values[best] >= LEAST_CORRELATION or best in (0, len(values) - 1) or within_s > WORST_S:
        return float("nan"), float(values[best]), within_s
    before, here, after = values[best - 1 : best + 2]
    bend = before - 2 * here + after
    offset = 0.5 * (before - after) / bend if bend < 0 else 0.0
    return float(lags_s[best] + offset * STEP_S), float(here), within_s


def _within(lags_s: FloatArray, values: FloatArray, rows: int) -> float:
    """Half the width of the lags that fit hardly worse than the best; at least half a step."""
    misfit = np.maximum(1.0 - values**2, 1e-12)
    likely = np.log(misfit / misfit[int(np.argmax(values))]) < LIKELY * ROWS_OF_A_DRAW / rows
    likely &= values > 0
    return float(0.5 * (np.ptp(lags_s[likely]) + STEP_S)) if likely.any() else LARGEST_S


def _correlation(a: FloatArray, b: FloatArray) -> float:
    """Of all columns together, each less its mean; 0 where one of them does not change."""
    a, b = a.reshape(len(b), -1) - a.reshape(len(b), -1).mean(axis=0), b.reshape(len(b), -1) - b.mean(axis=0)
    size = float(np.sqrt(np.sum(a**2) * np.sum(b**2)))
    return float(np.sum(a * b)) / size if size > 0 else 0.0
