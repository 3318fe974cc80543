"""An IMU that is late by its turning or its force, and the clocks that are off by more than a filter forgives."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inspection.evidence import (
    Diagnosis,
    correlation_of,
    means_of,
    moving_speed_mps,
    over_lengths,
    strength,
    track_windows,
    wheel_speeds,
    wheel_windows,
    without_nan_rows,
)
from jerkbench.inspection.lags import LEAST_ROWS, NAN, Lag, best_lag, estimated_lags
from jerkbench.io.frames import felt_axis
from jerkbench.recording import Recording

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

LONGEST_GAP_S = 0.5
"""Over longer steps an attitude is not interpolated."""

WINDOWS_S = (0.5, 1.0, 2.0)

OF_THE_TRACK, OF_A_WHEEL = "the turning of the track", "the acceleration of a wheel"

SHIFT_PARAMETERS = {
    "position": "position_shift_s",
    "velocity, horizontal": "velocity_shift_s",
    "velocity, up": "velocity_shift_s",
    "speed": "velocity_shift_s",
    "imu": "imu_shift_s",
}


Pairs = Callable[[float], tuple[FloatArray, FloatArray] | None]
"""What another stream says of the windows, and what the IMU says so much later; None: too few."""


def clock_offsets(lags: list[Lag]) -> list[Diagnosis]:
    """Return the streams whose stamps are off by .4 s or more; each parameter once."""
    offsets: dict[str, Diagnosis] = {}
    for lag in lags:
        strong = lag.correlation >= CLOCK_CORRELATION or lag.against == OF_A_WHEEL
        if not lag.sure or not strong or not abs(lag.lag_s) >= CLOCK_S:
            continue
        diagnosis = Diagnosis(
            f"clock of {lag.stream}",
            f"lag {lag.lag_s:+.2f} s against {lag.against}, give or take {lag.within_s:.2f} s (correlation"
            f" {lag.correlation:.2f})",
            f"The stamps of {lag.stream} are {abs(lag.lag_s):.2f} s {'late' if lag.lag_s > 0 else 'early'}",
            f"Add {-lag.lag_s:+.2f} to {SHIFT_PARAMETERS[lag.stream]}",
        )
        offsets.setdefault(SHIFT_PARAMETERS[lag.stream], diagnosis)
    return list(offsets.values())


def all_lags(recording: Recording) -> list[Lag]:
    """Return those of `estimated_lags` and that of `late_imu`."""
    late = late_imu(recording)
    return [*estimated_lags(recording), *([late] if late else [])]


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
        lags = [
            _turning_lag(against, pairs)
            for length_s in WINDOWS_S
            if (pairs := pairs_of(recording, length_s)) is not None
        ]
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
        return replace(lag, lag_s=NAN)
    found = strength(*agreement(lag.best_s))
    strong = lag.correlation >= CLOCK_CORRELATION or (against == OF_A_WHEEL and found >= WHEEL_SURE)
    sure = abs(lag.best_s) < CLOCK_S or found - strength(*agreement(0.0)) > CLOCK_SURE
    return replace(lag, lag_s=lag.best_s if strong else NAN, sure=sure)


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
    agreed = [
        np.array([_fits(windows[length_s].plane_mps2, windows[length_s].force_mps2) for windows in (at_none, at_lag)])
        for length_s in at_none.keys() & at_lag.keys()
    ]
    if not agreed:
        return False
    none, best = max(agreed, key=lambda both: float(both.sum(axis=1).max()))
    gain = best - none
    return bool(gain.sum() / np.sqrt(2.0) >= FELT_SURE and gain.min() > FELT_AGAINST)


def _fits(plane_mps2: FloatArray, force_mps2: FloatArray) -> list[float]:
    """Forward and left, in standard deviations from none."""
    return [strength(correlation_of(plane_mps2[:, axis], force_mps2[:, axis]), len(plane_mps2)) for axis in (0, 1)]


def _course_and_gyro(recording: Recording, length_s: float) -> Pairs | None:
    windows_at = track_windows(recording, length_s)
    if windows_at is None:
        return None
    return lambda late_s: (w.course_change_rad, w.turn_rad[:, 2]) if (w := windows_at(late_s)) is not None else None


def _wheel_and_force(recording: Recording, length_s: float) -> Pairs | None:
    windows_at = wheel_windows(recording, length_s)
    if windows_at is None:
        return None
    return lambda late_s: (w.plane_mps2[:, 0], w.force_mps2[:, 0]) if (w := windows_at(late_s)) is not None else None


def _attitude_and_gyro(recording: Recording, length_s: float) -> Pairs | None:
    imu, reference = recording.imu, recording.reference
    if imu is None or reference.euler_rad is None:
        return None
    t_s, euler_rad = without_nan_rows(reference.t_s, reference.euler_rad)
    if len(t_s) < LEAST_ROWS or np.median(np.diff(t_s)) > LONGEST_GAP_S:
        return None
    edges_s, means = np.arange(t_s[0], t_s[-1], length_s), means_of(imu.t_s, imu.gyro_radps)
    rates = attitude_rates(t_s, euler_rad, edges_s)

    def pairs(late_s: float) -> tuple[FloatArray, FloatArray] | None:
        inside = (edges_s[:-1] + late_s > imu.t_s[0]) & (edges_s[1:] + late_s < imu.t_s[-1])
        return (rates[inside], means(edges_s + late_s)[inside]) if inside.sum() >= LEAST_ROWS else None

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
    return np.column_stack(
        [
            dphi - dpsi * np.sin(theta),
            dtheta * np.cos(phi) + dpsi * np.sin(phi) * np.cos(theta),
            dpsi * np.cos(theta) * np.cos(phi) - dtheta * np.sin(phi),
        ]
    )
