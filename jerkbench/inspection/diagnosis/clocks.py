"""Clocks that are off by more than a filter forgives."""

from collections.abc import Callable

import numpy as np

from jerkbench.inspection.diagnosis.attitude import attitude_turning
from jerkbench.inspection.diagnosis.diagnosis import Diagnosis
from jerkbench.inspection.diagnosis.relation import strength
from jerkbench.inspection.diagnosis.wheel import wheel_windows
from jerkbench.inspection.diagnosis.windows import track_windows
from jerkbench.inspection.lags import Lag, estimated_lags
from jerkbench.inspection.peaks import LARGEST_S, correlation_of
from jerkbench.readers.gravity import felt_axis
from jerkbench.recording import Recording

LEAST_S = 0.4
"""A smaller lag is latency, which `estimated_lags` shows."""

LEAST_CORRELATION = 0.8
SURE, VERY_SURE = 4.0, 10.0

STEP_S = 0.1
WINDOWS_S = (0.5, 1.0, 2.0)

PARAMETERS = {
    "position": "position_shift_s",
    "velocity, horizontal": "velocity_shift_s",
    "velocity, up": "velocity_shift_s",
    "speed": "velocity_shift_s",
    "imu": "imu_shift_s",
}


def clock_offsets(recording: Recording) -> list[Diagnosis]:
    """Return the streams whose stamps are off by .4 s or more; each parameter once."""
    offsets: dict[str, Diagnosis] = {}
    lags = [lag for lag in estimated_lags(recording) if _far(lag)]
    late = late_imu(recording)
    for lag in lags:
        measured = f"lag {lag.lag_s:+.2f} s against {lag.against} (correlation {lag.correlation:.2f})"
        offsets.setdefault(PARAMETERS[lag.stream], _offset(lag.stream, lag.lag_s, measured))
    if late is not None and "imu_shift_s" not in offsets:
        late_s, against = late
        offsets["imu_shift_s"] = _offset("imu", late_s, f"lag {late_s:+.1f} s {against}")
    return list(offsets.values())


def late_imu(recording: Recording) -> tuple[float, str] | None:
    """Return how late the IMU is, and against what, where that is sure and .4 s or more.

    Over windows of half a second to two, r(tau) is the correlation of the gyro, tau later, with the course or with the
    turning of the reference's attitude, or of the forward force with a wheel's acceleration; it is sure where r is .8
    and more, of the noisy force ten standard deviations from none, and Fisher's atanh(r) is 4 standard deviations above
    that of no lag. While gravity is not on +z, the axes are wrong, and nothing is said.
    """
    if recording.imu is None or felt_axis(recording.imu.accel_mps2) != "+z":
        return None
    for against, agreement in AGREEMENTS.items():
        for length_s in WINDOWS_S:
            late_s = _best_lag(recording, agreement, length_s)
            if late_s is not None:
                return late_s, against
    return None


def _best_lag(recording: Recording, agreement: "Agreement", length_s: float) -> float | None:
    lags_s = np.asarray(np.arange(-LARGEST_S, LARGEST_S + STEP_S / 2, STEP_S), dtype=np.float64)
    ratings = [agreement(recording, length_s, float(lag_s)) for lag_s in (*lags_s, 0.0)]
    best = int(np.argmax([correlation for correlation, _ in ratings[:-1]]))
    (correlation, rows), (at_none, _) = ratings[best], ratings[-1]
    strong = correlation >= LEAST_CORRELATION or (
        agreement is _wheel_agreement and strength(correlation, rows) >= VERY_SURE
    )
    if not strong or abs(lags_s[best]) < LEAST_S or best in (0, len(lags_s) - 1):
        return None
    return float(lags_s[best]) if strength(correlation, rows) - strength(at_none, rows) > SURE else None


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
    "of its turning against the track's": _track_agreement,
    "of its turning against the reference's attitude": _attitude_agreement,
    "of its forward force against a wheel's acceleration": _wheel_agreement,
}
"""What the IMU is compared with: correlation and number of windows, of a length, with the IMU so much later."""


def _far(lag: Lag) -> bool:
    return bool(np.isfinite(lag.lag_s) and abs(lag.lag_s) >= LEAST_S and lag.correlation >= LEAST_CORRELATION)


def _offset(stream: str, lag_s: float, measured: str) -> Diagnosis:
    when = "late" if lag_s > 0 else "early"
    return Diagnosis(
        f"clock of {stream}",
        measured,
        f"The stamps of {stream} are {abs(lag_s):.2f} s {when}",
        f"Add {-lag_s:+.2f} to {PARAMETERS[stream]}",
    )
