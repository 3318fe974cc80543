"""Clocks that are off by more than a filter forgives."""

from collections.abc import Callable

import numpy as np

from jerkbench.inspection.diagnosis.attitude import attitude_turning
from jerkbench.inspection.diagnosis.diagnosis import Diagnosis
from jerkbench.inspection.diagnosis.relation import strength
from jerkbench.inspection.diagnosis.wheel import wheel_windows
from jerkbench.inspection.diagnosis.windows import track_windows
from jerkbench.inspection.lags import Lag, estimated_lags
from jerkbench.inspection.peaks import LARGEST_S, correlation_of, refined, within
from jerkbench.io.frames import felt_axis
from jerkbench.recording import Recording

LEAST_S = 0.4
"""A smaller lag is latency, which `estimated_lags` shows."""

LEAST_CORRELATION = 0.8
SURE, VERY_SURE = 4.0, 10.0

OF_A_WHEEL = "the acceleration of a wheel"

STEP_S = 0.1
FINE_S, FINE_STEPS = 0.02, 20
WINDOWS_S = (0.5, 1.0, 2.0)

PARAMETERS = {
    "position": "position_shift_s",
    "velocity, horizontal": "velocity_shift_s",
    "velocity, up": "velocity_shift_s",
    "speed": "velocity_shift_s",
    "imu": "imu_shift_s",
}


def clock_offsets(recording: Recording, late: Lag | None) -> list[Diagnosis]:
    """Return the streams whose stamps are off by .4 s or more; each parameter once. ``late`` is that of `late_imu`."""
    lags = [lag for lag in (*estimated_lags(recording), *([late] if late else [])) if _far(lag)]
    offsets: dict[str, Diagnosis] = {}
    for lag in lags:
        measured = (
            f"lag {lag.lag_s:+.2f} s against {lag.against}, give or take {lag.within_s:.2f} s (correlation"
            f" {lag.correlation:.2f})"
        )
        offsets.setdefault(PARAMETERS[lag.stream], _offset(lag.stream, lag.lag_s, measured))
    return list(offsets.values())


def late_imu(recording: Recording) -> Lag | None:
    """Return how late the IMU is, by its turning or by its force, where that is sure.

    Over windows of half a second to two, r(tau) is the correlation of the gyro, tau later, with the course or with the
    turning of the reference's attitude, or of the forward force with a wheel's acceleration; it is sure where r is .8
    and more, of the noisy force ten standard deviations from none. The windows that tell the lag best count. A lag of
    .4 s and more has to fit so much better than none that Fisher's atanh(r) is 4 standard deviations above that of no
    lag. While gravity is not on +z, the axes are wrong, and nothing is said.
    """
    if recording.imu is None or felt_axis(recording.imu.accel_mps2) != "+z":
        return None
    for against, agreement in AGREEMENTS.items():
        lags = [_best_lag(recording, against, agreement, length_s) for length_s in WINDOWS_S]
        sure = [lag for lag in lags if lag is not None]
        if sure:
            return min(sure, key=lambda lag: lag.within_s)
    return None


def _best_lag(recording: Recording, against: str, agreement: "Agreement", length_s: float) -> Lag | None:
    """Search in steps of .1 s, then in finer ones about the best, and between those with a parabola."""
    lags_s = np.asarray(np.arange(-LARGEST_S, LARGEST_S + STEP_S / 2, STEP_S), dtype=np.float64)
    coarse = [agreement(recording, length_s, float(lag_s))[0] for lag_s in lags_s]
    best = int(np.argmax(coarse))
    if best in (0, len(lags_s) - 1) or coarse[best] <= 0:
        return None
    lags_s = lags_s[best] + np.asarray(np.arange(-FINE_STEPS, FINE_STEPS + 1) * FINE_S, dtype=np.float64)
    values = np.array([agreement(recording, length_s, float(lag_s))[0] for lag_s in lags_s])
    finest = int(np.argmax(values))
    if finest in (0, len(lags_s) - 1):
        return None
    correlation, (_, rows) = float(values[finest]), agreement(recording, length_s, float(lags_s[finest]))
    lag = Lag("imu", against, refined(lags_s, values), correlation, within(lags_s, values, rows))
    strong = correlation >= LEAST_CORRELATION or (
        agreement is _wheel_agreement and strength(correlation, rows) >= VERY_SURE
    )
    if not strong or abs(lag.lag_s) < LEAST_S:
        return lag if strong else None
    at_none = strength(*agreement(recording, length_s, 0.0))
    return lag if strength(correlation, rows) - at_none > SURE else None


def _track_agreement(recording: Recording, length_s: float, late_s: float) -> tuple[float, int]:
    windows = track_windows(recording, length_s, late_s)
    if windows is None:
        return 0.0, 0
    return correlation_of(windows.course_change_rad, windows.turn_rad[:, 2]), len(windows)


def _attitude_agreement(recording: Recording, length_s: float, late_s: float) -> tuple[float, int]:
    turning = attitude_turning(recording, length_s, late_s)
    return (0.0, 0) if turning is None else (correlation_of(*turning), len(turning[0]))


def _wheel_agreement(recording: Recording, length_s: float, late_s: float) -> tuple[float, int]:
    windows = wheel_windows(recording, length_s, late_s)
    if windows is None:
        return 0.0, 0
    return correlation_of(windows.plane_mps2[:, 0], windows.force_mps2[:, 0]), len(windows)


Agreement = Callable[[Recording, float, float], tuple[float, int]]

AGREEMENTS: dict[str, Agreement] = {
    "the turning of the track": _track_agreement,
    "the turning of the reference's attitude": _attitude_agreement,
    OF_A_WHEEL: _wheel_agreement,
}
"""What the IMU is compared with: correlation and number of windows, of a length, with the IMU so much later."""


def _far(lag: Lag) -> bool:
    return bool(abs(lag.lag_s) >= LEAST_S and (lag.correlation >= LEAST_CORRELATION or lag.against == OF_A_WHEEL))


def _offset(stream: str, lag_s: float, measured: str) -> Diagnosis:
    when = "late" if lag_s > 0 else "early"
    return Diagnosis(
        f"clock of {stream}",
        measured,
        f"The stamps of {stream} are {abs(lag_s):.2f} s {when}",
        f"Add {-lag_s:+.2f} to {PARAMETERS[stream]}",
    )
