"""The lags between the streams of a recording."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inspection.evidence import (
    Diagnosis,
    Windows,
    common_edges,
    correlation_of,
    diagnosis,
    mean_velocity,
    means_of,
    moving_speed_mps,
    over_lengths,
    strength,
    track_windows,
    wheel_speeds,
    wheel_windows,
    without_nan_rows,
)
from jerkbench.io.frames import felt_axis
from jerkbench.recording import Imu, Position, Recording, Reference, Velocity

_NAN = float("nan")

MAX_LAG_S = 3.0
STEP_S = 0.02
"""The lags that are tried: every step from -largest to largest; between them a parabola."""

PART = 0.1
"""Of a short recording no larger part is tried as a lag: little would be left to compare."""

_MIN_ROWS = 20
MIN_CORRELATION = 0.5
"""With fewer rows, or a weaker relation at the best lag, none is stated."""

ROWS_OF_A_DRAW = 10
"""So many rows are worth one of a white residual: what is left at the best lag follows itself."""

LIKELY = 3.84
"""Chi-square of one degree of freedom, 95 %."""

WORST_S = 0.1
"""A lag of which no more than this is known is none."""

_MARGIN_S = 1.0
"""At the ends of the positions a spline's slope is poor."""

FAST_MPS = 1.0
"""Below, the speed's change is mostly noise."""

MIN_STEP_S, MAX_STEP_S = 0.2, 1.5
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
    lag_s: float = _NAN
    correlation: float = _NAN
    within_s: float = _NAN
    edge_s: float = _NAN
    best_s: float = _NAN
    at_none: float = _NAN
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
    lags, of_velocity = [], []
    if position is not None and (truth := _places(reference, position)) is not None:
        lags.append(_position_lag(position, *truth))
    fixes = 0 if position is None else int(np.isfinite(position.enu_m).all(axis=1).sum())
    if position is not None and velocity is not None and fixes > _MIN_ROWS:
        axes = {"velocity, horizontal": (0, 1), "velocity, up": (2,)} if velocity.frame == "enu" else {"speed": (0,)}
        of_velocity = [_velocity_lag(name, position, velocity, columns) for name, columns in axes.items()]
    speed = _speeds(recording, of_velocity)
    of_imu = [] if speed is None or recording.imu is None else [_imu_lag(recording.imu, *speed)]
    return [*lags, *of_velocity, *of_imu]


def best_lag(
    stream: str, against: str, correlation: Callable[[float], float], rows: int, largest_s: float = MAX_LAG_S
) -> Lag:
    """Return where ``correlation`` of a lag [s], over ``rows``, is largest up to ``largest_s``.

    A lag tau fits hardly worse than the best where (n/10) ln((1 - r(tau)^2)/(1 - r(best)^2)) < 3.84, r of n rows.
    """
    if rows < _MIN_ROWS:
        return Lag(stream, against)
    steps = round(largest_s / STEP_S)
    lags_s = np.asarray(np.arange(-steps, steps + 1) * STEP_S, dtype=np.float64)
    values = np.array([correlation(lag_s) for lag_s in lags_s])
    best = int(np.argmax(values))
    lag = Lag(stream, against, _NAN, float(values[best]), _within(lags_s, values, rows), at_none=float(values[steps]))
    if best in (0, len(values) - 1):
        return replace(lag, edge_s=float(lags_s[best])) if lag.correlation >= MIN_CORRELATION else lag
    before, peak, after = values[best - 1 : best + 2]  # the top of the parabola through them
    bend = before - 2 * peak + after
    offset = 0.5 * (before - after) / bend if bend < 0 else 0.0
    lag = replace(lag, best_s=float(lags_s[best] + offset * (lags_s[1] - lags_s[0])))
    is_known = lag.correlation >= MIN_CORRELATION and lag.within_s <= WORST_S
    return replace(lag, lag_s=lag.best_s) if is_known else lag


def _within(lags_s: FloatArray, values: FloatArray, rows: int) -> float:
    """Return half the width of the lags that fit hardly worse than the best; at least half a step."""
    misfit = np.maximum(1.0 - values**2, 1e-12)
    likely = np.log(misfit / misfit[int(np.argmax(values))]) < LIKELY * ROWS_OF_A_DRAW / rows
    likely &= values > 0
    return float(0.5 * (np.ptp(lags_s[likely]) + lags_s[1] - lags_s[0])) if likely.any() else float(lags_s[-1])


def _largest_s(t_s: FloatArray) -> float:
    return float(np.clip(PART * (t_s[-1] - t_s[0]), 0.6, MAX_LAG_S))


def _places(reference: Reference, position: Position) -> tuple[FloatArray, FloatArray] | None:
    """The places (k, 3) of a reference that is not the fixes, with their times; None without enough of them."""
    if reference.enu_m is None:
        return None
    if np.array_equal(reference.t_s, position.t_s) and np.array_equal(reference.enu_m, position.enu_m, equal_nan=True):
        return None
    t_s, enu_m = without_nan_rows(reference.t_s, reference.enu_m)
    return (t_s, enu_m) if len(t_s) > _MIN_ROWS else None


def _position_lag(position: Position, t_s: FloatArray, enu_m: FloatArray) -> Lag:
    """Compare the way from fix to fix with the reference's over the same time."""
    from scipy.interpolate import CubicSpline

    largest_s, way = _largest_s(t_s), CubicSpline(t_s, enu_m[:, :2])
    fix_s, places = without_nan_rows(position.t_s, position.enu_m[:, :2])
    begin, end = fix_s[:-1], fix_s[1:]
    use = (end - begin < MAX_STEP_S) & (begin > t_s[0] + largest_s) & (end < t_s[-1] - largest_s)
    begin, end, moved = begin[use], end[use], np.diff(places, axis=0)[use]

    def correlation(tau_s: float) -> float:
        return correlation_of(way(end - tau_s) - way(begin - tau_s), moved)

    return best_lag("position", "the reference", correlation, len(moved), largest_s)


def _velocity_lag(name: str, position: Position, velocity: Velocity, axes: tuple[int, ...]) -> Lag:
    """Compare the velocity with the slope of the positions on ``axes``; a speed with the slope's length."""
    from scipy.interpolate import CubicSpline

    fix_s, enu_m = without_nan_rows(position.t_s, position.enu_m)
    slope, largest_s = CubicSpline(fix_s, enu_m).derivative(), _largest_s(fix_s)
    begin_s, end_s = fix_s[[0, -1]] + np.array([1, -1]) * (_MARGIN_S + largest_s)
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
    t_s, places = t_s[:: _every(t_s)], places[:: _every(t_s)]
    return 0.5 * (t_s[1:] + t_s[:-1]), np.linalg.norm(mean_velocity(t_s, places, t_s), axis=1)


def _imu_lag(imu: Imu, against: str, t_s: FloatArray, speed_mps: FloatArray) -> Lag:
    """Compare the speed's changes with the integral of the forward force over the same time."""
    every, largest_s = _every(t_s), _largest_s(imu.t_s)
    t_s, speed_mps = t_s[::every], speed_mps[::every]
    gained = np.concatenate([[0.0], np.cumsum(imu.accel_mps2[1:, 0] * np.diff(imu.t_s))])
    begin, end, change = t_s[:-1], t_s[1:], np.diff(speed_mps)
    use = (np.minimum(speed_mps[:-1], speed_mps[1:]) > FAST_MPS) & (end - begin < MAX_STEP_S)
    use &= (begin > imu.t_s[0] + largest_s) & (end < imu.t_s[-1] - largest_s)
    begin, end, change = begin[use], end[use], change[use]

    def correlation(tau_s: float) -> float:
        felt = np.interp(end + tau_s, imu.t_s, gained) - np.interp(begin + tau_s, imu.t_s, gained)
        return correlation_of(felt, change)

    return best_lag("imu", against, correlation, len(change), largest_s)


def _every(t_s: FloatArray) -> int:
    """Every so many rows the steps are long enough for a change to show."""
    return max(1, round(MIN_STEP_S / float(np.median(np.diff(t_s))))) if len(t_s) > 1 else 1


# An IMU that is late by its turning or its force, and the clocks that are off by more than a filter forgives.

FILTER_S = 0.05
"""A sensor's own low-pass filter delays its rates by up to so much, which is no fault of the stamps. The rates of
KITTI's OXTS unit are 0.05 s behind its attitude, and its forces are not."""

LEVER_M = 0.5
"""A place so far ahead of the point about which a vehicle turns has a course that is early by this over the speed."""

CLOCK_S, CLOCK_CORRELATION, CLOCK_SURE = 0.4, 0.8, 4.0
"""A smaller lag is latency; a clock that is off has to show by so much, and fit so many sigmas better than none."""

WHEEL_SURE = 10.0
"""A wheel's acceleration against the noisy force may correlate less, but by so many sigmas."""

FELT_SURE, FELT_AGAINST = 2.0, -1.0
"""The accelerometer confirms a lag of the gyro's by so many sigmas over no lag, and contradicts it on no axis."""

MAX_GAP_S = 0.5
"""Over longer steps an attitude is not interpolated."""

WINDOWS_S = (0.5, 1.0, 2.0)

OF_THE_TRACK, OF_A_WHEEL = "the turning of the track", "the acceleration of a wheel"

SHIFT_PARAMETERS = {"position": "position_shift_s", "imu": "imu_shift_s"}
SHIFT_PARAMETERS |= dict.fromkeys(("velocity, horizontal", "velocity, up", "speed"), "velocity_shift_s")
LATENCIES = {"position_shift_s": "position_latency_s={0:.2f}", "velocity_shift_s": "velocity_latency_s=[{0:.2f}, ...]"}
"""The parameters of the data sets that read tables, and of those that read bags."""

Pairs = Callable[[float], tuple[FloatArray, FloatArray] | None]
"""What another stream says of the windows, and what the IMU says so much later; None: too few."""


def clock_offsets(lags: list[Lag]) -> list[Diagnosis]:
    """Return the streams whose stamps are off by .4 s or more; each parameter once."""
    offsets: dict[str, Diagnosis] = {}
    for lag in lags:
        strong = lag.correlation >= CLOCK_CORRELATION or lag.against == OF_A_WHEEL
        if not lag.sure or not strong or not abs(lag.lag_s) >= CLOCK_S:
            continue
        measured = f"lag {lag.lag_s:+.2f} s against {lag.against}, give or take {lag.within_s:.2f} s"
        parts = {"stream": lag.stream, "size": abs(lag.lag_s), "side": "late" if lag.lag_s > 0 else "early"}
        parts |= {"shift": -lag.lag_s, "parameter": (parameter := SHIFT_PARAMETERS[lag.stream])}
        if parameter in LATENCIES:
            parts["parameter"] = (
                f"{parameter} (dataset=table), or set {LATENCIES[parameter].format(lag.lag_s)} of a bag"
            )
        offsets.setdefault(parameter, diagnosis("clock", f"{measured} (correlation {lag.correlation:.2f})", **parts))
    return list(offsets.values())


def all_lags(recording: Recording) -> list[Lag]:
    """Return those of `estimated_lags` and that of `late_imu`; of late fixes that of the fixes alone."""
    late = late_imu(recording)
    return of_late_fixes([*estimated_lags(recording), *([late] if late else [])])


def of_late_fixes(lags: list[Lag]) -> list[Lag]:
    """Return the lag of the fixes alone where several sensors differ from the fixes by one time, each in its own way.

    The lags of velocity and IMU are relative to the fixes, directly or by a velocity at its corrected stamps. If both,
    or one of them and the reference, say that the fixes are late by one time, the fixes are late and nothing else is.
    """
    late_s = [(lag.lag_s if lag.stream == "position" else -lag.lag_s, lag) for lag in lags if np.isfinite(lag.lag_s)]
    for first_s, first in late_s:
        agreed = [lag for one_s, lag in late_s if abs(one_s - first_s) <= WORST_S]
        kinds = {lag.stream.partition(",")[0] for lag in agreed}
        witnesses = first.stream == "position" or (first.stream != "imu" and "imu" in kinds)
        if abs(first_s) >= CLOCK_S and witnesses and len(kinds) > 1:
            others = " and ".join(sorted({"the reference" if kind == "position" else kind for kind in kinds}))
            return [replace(first, stream="position", against=f"{others}, which agree with each other", lag_s=first_s)]
    return lags


def late_imu(recording: Recording) -> Lag | None:
    """Return how late the IMU is, by its turning or by its force; None where neither shows it.

    Over windows of half a second to two, r(tau) is the correlation of the gyro, tau later, with the turning of the
    reference's attitude or with the course, or of the forward force with a wheel's acceleration. It counts where r is
    .8 and more, of the noisy force ten standard deviations from none. The windows that tell the lag best count.

    The interval has .05 s for the sensor's own filter and, where the track is compared, what half a metre between the
    antenna and the point about which the vehicle turns does to a course.

    A lag of .4 s and more is sure where it fits so much better than none that Fisher's atanh(r) is 4 standard
    deviations above that of no lag. A course tells of stamps only if the body cannot turn before it goes, as a hand or
    a drone does: there has to be a wheel, or the accelerometer has to agree with the track better at that lag than at
    none. While gravity is not on +z, the axes are wrong, and nothing is said.
    """
    if recording.imu is None or felt_axis(recording.imu.accel_mps2) != "+z":
        return None
    for against, pairs_of in TURNINGS.items():
        lags = [_turning_lag(against, pairs) for length_s in WINDOWS_S if (pairs := pairs_of(recording, length_s))]
        if strong := [lag for lag in lags if np.isfinite(lag.lag_s)]:
            return _judged(recording, min(strong, key=lambda lag: (not lag.sure, lag.within_s)))
    return None


def _turning_lag(against: str, pairs: Pairs) -> Lag:
    """Return the best lag, which is no number where the relation is weak."""

    def agreement(late_s: float) -> tuple[float, int]:
        pair = pairs(late_s)
        return (0.0, 0) if pair is None else (correlation_of(*pair), len(pair[0]))

    lag = best_lag("imu", against, lambda late_s: agreement(late_s)[0], agreement(0.0)[1])
    if np.isnan(lag.best_s):
        return replace(lag, lag_s=_NAN)
    found = strength(*agreement(lag.best_s))
    strong = lag.correlation >= CLOCK_CORRELATION or (against == OF_A_WHEEL and found >= WHEEL_SURE)
    sure = abs(lag.best_s) < CLOCK_S or found - strength(*agreement(0.0)) > CLOCK_SURE
    return replace(lag, lag_s=lag.best_s if strong else _NAN, sure=sure)


def _judged(recording: Recording, lag: Lag) -> Lag:
    """Widen the interval by what stamps do not cause, and ask whether the body can have turned before it went."""
    if lag.against != OF_THE_TRACK or recording.position is None:
        return replace(lag, within_s=lag.within_s + FILTER_S)
    within_s = lag.within_s + FILTER_S + LEVER_M / moving_speed_mps(recording.position)
    sure = lag.sure and (wheel_speeds(recording) is not None or _is_felt(recording, lag.lag_s))
    return replace(lag, within_s=within_s, sure=sure)


def _is_felt(recording: Recording, lag_s: float) -> bool:
    """Whether the accelerometer agrees with the track's acceleration better at a lag than at none."""
    at_none, at_lag = over_lengths(track_windows, recording), over_lengths(track_windows, recording, lag_s)
    both = at_none.keys() & at_lag.keys()
    agreed = [np.array([_fits(windows[length_s]) for windows in (at_none, at_lag)]) for length_s in both]
    if not agreed:
        return False
    none, best = max(agreed, key=lambda both: float(both.sum(axis=1).max()))
    gain = best - none
    return bool(gain.sum() / np.sqrt(2.0) >= FELT_SURE and gain.min() > FELT_AGAINST)


def _fits(w: Windows) -> list[float]:
    """Forward and left, in standard deviations from none."""
    return [strength(correlation_of(w.plane_mps2[:, axis], w.force_mps2[:, axis]), len(w)) for axis in (0, 1)]


def _course_and_gyro(recording: Recording, length_s: float) -> Pairs | None:
    at = track_windows(recording, length_s)
    return at and (lambda late_s: (w.course_change_rad, w.turn_rad[:, 2]) if (w := at(late_s)) else None)


def _wheel_and_force(recording: Recording, length_s: float) -> Pairs | None:
    at = wheel_windows(recording, length_s)
    return at and (lambda late_s: (w.plane_mps2[:, 0], w.force_mps2[:, 0]) if (w := at(late_s)) else None)


def _attitude_and_gyro(recording: Recording, length_s: float) -> Pairs | None:
    imu, reference = recording.imu, recording.reference
    if imu is None or reference.euler_rad is None:
        return None
    t_s, euler_rad = without_nan_rows(reference.t_s, reference.euler_rad)
    if len(t_s) < _MIN_ROWS or np.median(np.diff(t_s)) > MAX_GAP_S:
        return None
    edges_s, means = common_edges(length_s, t_s), means_of(imu.t_s, imu.gyro_radps)
    rates = attitude_rates(t_s, euler_rad, edges_s)

    def pairs(late_s: float) -> tuple[FloatArray, FloatArray] | None:
        inside = (edges_s[:-1] + late_s > imu.t_s[0]) & (edges_s[1:] + late_s < imu.t_s[-1])
        return (rates[inside], means(edges_s + late_s)[inside]) if inside.sum() >= _MIN_ROWS else None

    return pairs


TURNINGS: dict[str, Callable[[Recording, float], Pairs | None]] = {
    "the turning of the reference's attitude": _attitude_and_gyro,
    OF_THE_TRACK: _course_and_gyro,
    OF_A_WHEEL: _wheel_and_force,
}
"""What the IMU is compared with."""


def attitude_rates(t_s: FloatArray, euler_rad: FloatArray, edges_s: FloatArray) -> FloatArray:
    """Return the rates (n, 3) in the body of an attitude (m, 3), over the windows between n + 1 edges.

    With phi, theta, psi for Rz(psi) Ry(theta) Rx(phi)::

        p = phi' - psi' sin(theta),  q = theta' cos(phi) + psi' sin(phi) cos(theta),
        r = psi' cos(theta) cos(phi) - theta' sin(phi)
    """
    unwrapped = np.unwrap(euler_rad, axis=0)
    angles = np.column_stack([np.interp(edges_s, t_s, column) for column in unwrapped.T])
    phi, theta, _ = (0.5 * (angles[1:] + angles[:-1])).T
    dphi, dtheta, dpsi = (np.diff(angles, axis=0) / np.diff(edges_s)[:, None]).T
    p, q = dphi - dpsi * np.sin(theta), dtheta * np.cos(phi) + dpsi * np.sin(phi) * np.cos(theta)
    return np.column_stack([p, q, dpsi * np.cos(theta) * np.cos(phi) - dtheta * np.sin(phi)])
