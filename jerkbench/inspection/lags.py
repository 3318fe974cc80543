"""Estimation of the time lags between the streams of a recording."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.geometry import dcm_from_euler
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
    window_means,
    without_nan_rows,
)
from jerkbench.io.conversions import felt_axis
from jerkbench.recording import Imu, Position, Recording, Reference, Velocity

_NAN = float("nan")

MAX_LAG_S = 3.0
STEP_S = 0.02
"""Maximum lag and step of the search [s]; a parabola interpolates between the steps."""

PART = 0.1
"""Maximum lag as a fraction of the duration of a short recording. With a longer lag too few rows could be compared."""

_MIN_ROWS = 20
MIN_CORRELATION = 0.5
"""Minimum number of rows and minimum correlation at the best lag; otherwise the lag is unknown."""

ROWS_PER_INDEPENDENT_ROW = 10
"""Assumed number of rows that count as one independent row, because the residual at the best lag is autocorrelated."""

CHI2_95 = 3.84
"""Chi-square of one degree of freedom, 95 %."""

MAX_UNCERTAINTY_S = 0.1
"""Maximum uncertainty of a lag [s]. A lag with a larger uncertainty is unknown."""

_MARGIN_S = 1.0
"""Margin at both ends of the positions, where the slope of a spline is inaccurate."""

FAST_MPS = 1.0
"""Minimum speed [m/s]. At lower speeds, the change of the speed is mostly noise."""

MIN_STEP_S, MAX_STEP_S = 0.2, 1.5
"""Range of the time steps over which changes are compared [s]. In a shorter step the change of a speed is mostly noise.
With longer steps there are too few changes."""


@dataclass(frozen=True)
class Lag:
    """Time lag of one stream behind another stream.

    Attributes:
        stream: stream with the lag: "position", "velocity, horizontal", "velocity, up", "speed" or "imu".
        against: stream relative to which the lag was estimated.
        lag_s: lag, which is subtracted from the stamps to correct them [s]; NaN if the uncertainty is too large.
        correlation: correlation of the two streams at the best lag; NaN if there are too few rows.
        within_s: half the width of the 95 % interval of the lag [s].
        edge_s: limit of the search if the best lag is at this limit, so that the true lag may be larger; else NaN [s].
        best_s: lag with the largest correlation, even if it is not significant; NaN at a limit of the search [s].
        at_none: correlation of the two streams without a time shift.
        sure: true if wrong stamps are the only explanation of the lag.
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
    """Return the lags, up to 3 s, of position, velocity and IMU, if another stream exists for comparison.

    The lag of the position is computed from r(t), the cubic spline through the positions of the reference::

        lag = argmax over tau of corr(r(t_i+1 - tau) - r(t_i - tau), p_i+1 - p_i)

    The lags of horizontal and vertical velocity are computed from s(t), the cubic spline through the positions::

        lag = argmax over tau of corr(s'(t_i - tau), v_i)

    The lag of a speed is computed in the same way from |s'|. The lag of the IMU is computed from the velocity v with
    lag-corrected stamps. Without a velocity, v is the velocity of the reference, or else the difference quotient of
    positions::

        lag = argmax over tau of corr(int over (t_i + tau, t_i+1 + tau) of f_x dt, |v_i+1| - |v_i|)

    Only speeds above 1 m/s are used for the lag of the IMU. The forward acceleration of a vehicle is on its x axis,
    independently of the yaw. On a slope, gravity adds a component that changes slowly. The accelerometer must be in
    body axes. A reference that is a copy of the fixes is not used for the lag of the position.
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
    """Return the lag between -``largest_s`` and ``largest_s`` [s] with the largest ``correlation``.

    The 95 % interval contains the lags tau with (n/10) ln((1 - r(tau)^2)/(1 - r(best)^2)) < 3.84, where r is the
    correlation and n is the number of compared rows.
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
    before, peak, after = values[best - 1 : best + 2]  # a parabola through these values gives the maximum
    bend = before - 2 * peak + after
    offset = 0.5 * (before - after) / bend if bend < 0 else 0.0
    lag = replace(lag, best_s=float(lags_s[best] + offset * (lags_s[1] - lags_s[0])))
    is_known = lag.correlation >= MIN_CORRELATION and lag.within_s <= MAX_UNCERTAINTY_S
    return replace(lag, lag_s=lag.best_s) if is_known else lag


def _within(lags_s: FloatArray, values: FloatArray, rows: int) -> float:
    """Return half the width of the 95 % interval of the lag, which is at least half a step of the search."""
    misfit = np.maximum(1.0 - values**2, 1e-12)
    likely = np.log(misfit / misfit[int(np.argmax(values))]) < CHI2_95 * ROWS_PER_INDEPENDENT_ROW / rows
    likely &= values > 0
    return float(0.5 * (np.ptp(lags_s[likely]) + lags_s[1] - lags_s[0])) if likely.any() else float(lags_s[-1])


def _largest_s(t_s: FloatArray) -> float:
    return float(np.clip(PART * (t_s[-1] - t_s[0]), 0.6, MAX_LAG_S))


def _places(reference: Reference, position: Position) -> tuple[FloatArray, FloatArray] | None:
    """Return the times and positions (k, 3) of the reference, or None for too few rows or a copy of the fixes."""
    if reference.enu_m is None:
        return None
    if np.array_equal(reference.t_s, position.t_s) and np.array_equal(reference.enu_m, position.enu_m, equal_nan=True):
        return None
    t_s, enu_m = without_nan_rows(reference.t_s, reference.enu_m)
    return (t_s, enu_m) if len(t_s) > _MIN_ROWS else None


def _position_lag(position: Position, t_s: FloatArray, enu_m: FloatArray) -> Lag:
    """Return the lag of the fixes, from the displacements of fixes and reference between consecutive fixes."""
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
    """Return the lag of a velocity or a speed behind the derivative of the positions, for the columns ``axes``."""
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
    """Return the name, corrected times (m,) and speeds (m,) of the stream that is compared with the IMU."""
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
        against = "the reference's positions, differentiated twice"
        return against, *_speed_between_positions(reference.t_s, reference.enu_m)
    if position is not None:
        return "positions, differentiated twice", *_speed_between_positions(position.t_s, position.enu_m)
    return None


def _speed_between_positions(t_s: FloatArray, enu_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the middle times between consecutive positions, and the mean speeds between these positions."""
    t_s, places = without_nan_rows(t_s, enu_m[:, :2])
    t_s, places = t_s[:: _every(t_s)], places[:: _every(t_s)]
    return 0.5 * (t_s[1:] + t_s[:-1]), np.linalg.norm(mean_velocity(t_s, places, t_s), axis=1)


def _imu_lag(imu: Imu, against: str, t_s: FloatArray, speed_mps: FloatArray) -> Lag:
    """Return the lag of the integral of the forward specific force behind the changes of a speed."""
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
    """Return the stride between rows that gives time steps of about `MIN_STEP_S` for the changes of the speed."""
    return max(1, round(MIN_STEP_S / float(np.median(np.diff(t_s))))) if len(t_s) > 1 else 1


# Lag of the IMU from its angular rate or specific force, and clock offsets that are too large for a filter.

FILTER_S = 0.05
"""Maximum delay of a sensor's internal low-pass filter [s], which is not an error of the stamps. In the OXTS unit of
KITTI, the angular rates are 0.05 s behind the attitude, but the specific forces are not."""

LEVER_M = 0.5
"""Assumed distance of the antenna ahead of the point about which a vehicle turns [m]. The course of the antenna is
early by distance/speed."""

CLOCK_S, CLOCK_CORRELATION, MIN_CLOCK_GAIN = 0.4, 0.8, 4.0
"""Minimum lag [s] of a clock offset (a smaller lag is a latency), its minimum correlation, and the minimum increase of
the significance over the significance without a shift, in standard deviations."""

MIN_WHEEL_STRENGTH = 10.0
"""Minimum significance, in standard deviations, of the correlation with a wheel's acceleration. For a wheel, this limit
replaces the minimum correlation, because the correlation with a wheel is lower."""

MIN_CONFIRMING_GAIN, MIN_AXIS_GAIN = 2.0, -1.0
"""Minimum increase of the significance, in standard deviations, with which the accelerometer confirms a lag of the
gyro: for both axes together, and for each axis."""

MAX_GAP_S = 0.5
"""Maximum interval over which an attitude is interpolated [s]."""

WINDOWS_S = (0.5, 1.0, 2.0)

OF_THE_TRACK, OF_A_WHEEL = "the turn rate of the track", "the acceleration of a wheel"

SHIFT_PARAMETERS = {"position": "position_shift_s", "imu": "imu_shift_s"}
SHIFT_PARAMETERS |= dict.fromkeys(("velocity, horizontal", "velocity, up", "speed"), "velocity_shift_s")
LATENCIES = {"position_shift_s": "position_latency_s={0:.2f}", "velocity_shift_s": "velocity_latency_s=[{0:.2f}, ...]"}
"""Parameter that corrects the lag of each stream in data sets that read tables, and the corresponding setting of data
sets that read bags."""

Pairs = Callable[[float], tuple[FloatArray, FloatArray] | None]
"""A function of the delay [s] of the IMU that returns values of another stream and of the IMU in the same windows; None
if there are too few windows."""


MAX_STEP_IN_BUNCH, MIN_STAMPS_IN_BUNCH = 0.1, 0.5
"""Maximum step of the stamps in a bunch, as a fraction of the mean step, and minimum fraction of such steps."""


def bunched_stamps(recording: Recording) -> list[Diagnosis]:
    """Report IMU stamps in bunches, which are times of arrival, whereas the sensor measured at equal intervals."""
    if recording.imu is None or len(recording.imu.t_s) <= _MIN_ROWS:
        return []
    steps_s = np.diff(recording.imu.t_s)
    rate_hz = 1.0 / float(steps_s.mean())
    short = steps_s < MAX_STEP_IN_BUNCH / rate_hz
    if short.mean() < MIN_STAMPS_IN_BUNCH:
        return []
    count, gap_ms = 1.0 / (1.0 - short.mean()), 1e3 * np.median(steps_s[~short])
    measured = f"about {count:.0f} stamps at once, then a gap of {gap_ms:.3g} ms; the mean rate is {rate_hz:.0f} Hz"
    return [diagnosis("bunched_stamps", measured, rate_hz=rate_hz)]


def clock_offsets(lags: list[Lag]) -> list[Diagnosis]:
    """Return the diagnoses of clock offsets of at least 0.4 s, at most one for each parameter."""
    offsets: dict[str, Diagnosis] = {}
    for lag in lags:
        strong = lag.correlation >= CLOCK_CORRELATION or lag.against == OF_A_WHEEL
        if not lag.sure or not strong or not abs(lag.lag_s) >= CLOCK_S:
            continue
        measured = f"lag {lag.lag_s:+.2f} s +- {lag.within_s:.2f} s against {lag.against}"
        parts = {"stream": lag.stream, "size": abs(lag.lag_s), "side": "late" if lag.lag_s > 0 else "early"}
        parts |= {"shift": -lag.lag_s, "parameter": (parameter := SHIFT_PARAMETERS[lag.stream])}
        if parameter in LATENCIES:
            latency = LATENCIES[parameter].format(lag.lag_s)
            parts["parameter"] = f"{parameter} (dataset=table), or set {latency} for a bag"
        offsets.setdefault(parameter, diagnosis("clock", f"{measured} (correlation {lag.correlation:.2f})", **parts))
    return list(offsets.values())


def all_lags(recording: Recording) -> list[Lag]:
    """Return the lags of `estimated_lags` and `late_imu`, or only the lag of the fixes if the fixes are late."""
    late = late_imu(recording)
    return of_late_fixes([*estimated_lags(recording), *([late] if late else [])])


def of_late_fixes(lags: list[Lag]) -> list[Lag]:
    """Return ``lags``, or only the lag of the fixes if several streams have the same lag relative to the fixes.

    The lags of velocity and IMU are relative to the fixes, directly or through a velocity with corrected stamps. If at
    least two of the streams velocity, IMU and reference imply the same lag of the fixes, only the fixes are late.
    """
    late_s = [(lag.lag_s if lag.stream == "position" else -lag.lag_s, lag) for lag in lags if np.isfinite(lag.lag_s)]
    for first_s, first in late_s:
        agreed = [lag for one_s, lag in late_s if abs(one_s - first_s) <= MAX_UNCERTAINTY_S]
        kinds = {lag.stream.partition(",")[0] for lag in agreed}
        witnesses = first.stream == "position" or (first.stream != "imu" and "imu" in kinds)
        if abs(first_s) >= CLOCK_S and witnesses and len(kinds) > 1:
            others = " and ".join(sorted({"the reference" if kind == "position" else kind for kind in kinds}))
            return [replace(first, stream="position", against=f"{others}, which agree with each other", lag_s=first_s)]
    return lags


def late_imu(recording: Recording) -> Lag | None:
    """Return the lag of the IMU from its angular rate or its specific force, or None if the lag is not identified.

    In windows of 0.5 to 2 s, r(tau) is the correlation of the IMU at the time t + tau with another stream at the time
    t. The gyro is compared with the rotation of the reference attitude or with the change of the course. The forward
    specific force is compared with the acceleration of a wheel. A lag is used if r is at least 0.8. For the noisy
    specific force, it is sufficient that r is ten standard deviations from zero. The window length with the smallest
    uncertainty is used.

    The uncertainty of the lag includes 0.05 s for the internal filter of the sensor. For the track, the uncertainty
    also includes the effect of a distance of 0.5 m between the antenna and the point about which the vehicle turns.

    A lag of 0.4 s or more is certain if Fisher's atanh(r) is 4 standard deviations above its value without a shift.
    Because a hand-held sensor or a drone may turn before it moves, a lag that was computed from a course is certain
    only if the recording has a wheel, or if the accelerometer agrees with the track better at this lag than without a
    shift. If gravity is not on +z, the axes are wrong, and the function returns None.
    """
    if recording.imu is None or felt_axis(recording.imu.accel_mps2) != "+z":
        return None
    for against, pairs_of in TURNINGS.items():
        lags = [_turning_lag(against, pairs) for length_s in WINDOWS_S if (pairs := pairs_of(recording, length_s))]
        if strong := [lag for lag in lags if np.isfinite(lag.lag_s)]:
            return _judged(recording, min(strong, key=lambda lag: (not lag.sure, lag.within_s)))
    return None


def _turning_lag(against: str, pairs: Pairs) -> Lag:
    """Return the lag with the largest correlation. If the correlation is weak, the attribute ``lag_s`` is NaN."""

    def agreement(late_s: float) -> tuple[float, int]:
        pair = pairs(late_s)
        return (0.0, 0) if pair is None else (correlation_of(*pair), len(pair[0]))

    lag = best_lag("imu", against, lambda late_s: agreement(late_s)[0], agreement(0.0)[1])
    if np.isnan(lag.best_s):
        return replace(lag, lag_s=_NAN)
    found = strength(*agreement(lag.best_s))
    strong = lag.correlation >= CLOCK_CORRELATION or (against == OF_A_WHEEL and found >= MIN_WHEEL_STRENGTH)
    sure = abs(lag.best_s) < CLOCK_S or found - strength(*agreement(0.0)) > MIN_CLOCK_GAIN
    return replace(lag, lag_s=lag.best_s if strong else _NAN, sure=sure)


def _judged(recording: Recording, lag: Lag) -> Lag:
    """Add the effects of the internal filter and of the antenna position to the uncertainty of the lag.

    A lag that was computed from the course is uncertain if the body may turn before it moves. The function sets
    ``sure`` to False in this case.
    """
    if lag.against != OF_THE_TRACK or recording.position is None:
        return replace(lag, within_s=lag.within_s + FILTER_S)
    within_s = lag.within_s + FILTER_S + LEVER_M / moving_speed_mps(recording.position)
    sure = lag.sure and (wheel_speeds(recording) is not None or _is_felt(recording, lag.lag_s))
    return replace(lag, within_s=within_s, sure=sure)


def _is_felt(recording: Recording, lag_s: float) -> bool:
    """Return True if a correction of the lag improves the agreement of accelerometer and track."""
    at_none, at_lag = over_lengths(track_windows, recording), over_lengths(track_windows, recording, lag_s)
    both = at_none.keys() & at_lag.keys()
    agreed = [np.array([_fits(windows[length_s]) for windows in (at_none, at_lag)]) for length_s in both]
    if not agreed:
        return False
    none, best = max(agreed, key=lambda both: float(both.sum(axis=1).max()))
    gain = best - none
    return bool(gain.sum() / np.sqrt(2.0) >= MIN_CONFIRMING_GAIN and gain.min() > MIN_AXIS_GAIN)


def _fits(w: Windows) -> list[float]:
    """Return the significance of the correlations of the forward and left axes, in standard deviations from zero."""
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
    "the turn rate of the reference's attitude": _attitude_and_gyro,
    OF_THE_TRACK: _course_and_gyro,
    OF_A_WHEEL: _wheel_and_force,
}
"""Functions that compare the IMU with another stream, by the name of this stream, in the order of preference."""


def attitude_rates(t_s: FloatArray, euler_rad: FloatArray, edges_s: FloatArray) -> FloatArray:
    """Return the body rates (n, 3) [rad/s] of an attitude (m, 3), averaged between n + 1 window edges.

    The rate between two rows is the rotation vector from one attitude to the next, divided by their interval.
    """
    from scipy.spatial.transform import Rotation

    attitude = Rotation.from_matrix(dcm_from_euler(euler_rad))
    rates = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / np.diff(t_s)[:, None]
    return window_means(t_s[1:], rates, edges_s)
