"""Evidence for the diagnostics: comparison of the IMU with a track or a wheel speed in common time windows."""

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.recording import Imu, Position, Recording

_LENGTHS_S = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Lengths of the windows [s]. Long windows reduce noise, and short windows resolve a winding track. Each check uses the
length with the most significant result."""

MIN_COURSE_MPS = 0.5
"""Minimum speed at which a track of fixes has a course [m/s]."""

_MAX_ANGLE_RAD = 1.5
"""Maximum change of the course in a window. A larger change is ambiguous: a turn to the other side, or noise."""

MIN_WINDOWS = 20

DEG_PER_RAD = float(np.degrees(1.0))

MAX_RATE_RATIO = 2.5
"""Tolerance of a measured turn rate, as a factor. Windows, vibration and noise distort the turn rate."""

GRAVITY_WINDOWS_S = (1.0, 2.0)
"""Lengths of the windows of the specific force [s]. In shorter windows, vibration dominates."""

MIN_FORCE_MPS2 = 1e-6
"""Minimum norm of a specific force that has a direction."""

MIN_LOW_NORM = 0.5
"""Minimum first norm of `low_and_median_norm`, as a fraction of the second, if the specific force has gravity."""

_BLOCK = 20
"""Number of rows over which vibration is averaged."""

MAX_WINDOWS, MAX_WINDOWS_PER_ROW = 100_000, 10
"""The maximum number of windows is the larger of a constant and a multiple of the number of rows. If there were more
windows, most of the windows would be empty."""

MIN_STRENGTH = 5.0
"""Minimum significance of a correlation, in standard deviations from zero, which is high because of many tests."""


MISTAKES = tomllib.loads((Path(__file__).parent / "mistakes.toml").read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Diagnosis:
    """A mistake in a recording, with the measurement that shows it and the remedy.

    Attributes:
        name: short name of the mistake for tables, for example "accelerometer in g".
        measured: the measurement that shows the mistake, with its unit.
        finding: description of the mistake, a sentence without a full stop.
        remedy: description of the correction, a sentence without a full stop.
    """

    name: str
    measured: str
    finding: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.finding}. Measured: {self.measured}. {self.remedy}."


def low_and_median_norm(accel: FloatArray) -> tuple[float, float]:
    """Return the 5 % quantile of the norm of averaged specific forces, and the median norm of specific forces (n, 3).

    An average over a short block of rows contains gravity, but hardly any vibration. Rows of zeros are ignored.
    """
    measured = accel[accel.any(axis=1)]
    blocks = measured[: len(measured) // _BLOCK * _BLOCK].reshape(-1, _BLOCK, 3).mean(axis=1)
    if not len(blocks):
        return np.inf, float(np.median(np.linalg.norm(accel, axis=1)))
    lowest = float(np.quantile(np.linalg.norm(blocks, axis=1), 0.05))
    return lowest, float(np.median(np.linalg.norm(measured, axis=1)))


def diagnosis(mistake: str, measured: str, **parts: object) -> Diagnosis:
    """Return the diagnosis of a ``mistake`` in `MISTAKES`. The ``parts`` replace the placeholders in its texts."""
    return Diagnosis(measured=measured, **{key: text.format(**parts) for key, text in MISTAKES[mistake].items()})


@dataclass(frozen=True, eq=False)
class Windows:
    """Motion according to a track or a wheel, and measurements of the IMU, in the same n time windows.

    Attributes:
        course_change_rad: (n,) change of the course of the track in each window, positive to the left [rad]. For a
            wheel, which has no course, the integral of the z axis of the gyro is used.
        plane_mps2: (n, 2) forward and left acceleration of the vehicle, from the track or the wheel [m/s2].
        turn_rad: (n, 3) integral of the angular rate over each window [rad].
        force_mps2: (n, 3) mean specific force in each window [m/s2].
    """

    course_change_rad: FloatArray
    plane_mps2: FloatArray
    turn_rad: FloatArray
    force_mps2: FloatArray

    def __len__(self) -> int:
        return len(self.course_change_rad)


WindowsAt = Callable[[float], Windows | None]
"""A function of the delay [s] of the IMU's stamps that returns the windows, or None for fewer than 20 usable
windows."""


def without_nan_rows(t_s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the times and values of the rows in which all values (n, k) are finite."""
    rows = np.isfinite(values).all(axis=1)
    return t_s[rows], values[rows]


def means_of(t_s: FloatArray, values: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Return a function that computes the means (n, k) of ``values`` between n + 1 window edges.

    Each row of ``values`` (m, k) is the mean over the interval that ends at the stamp of the row.
    """
    ends_s = np.concatenate([[t_s[0] - np.median(np.diff(t_s))], t_s])
    total = np.vstack([np.zeros(values.shape[1]), np.cumsum(values * np.diff(ends_s)[:, None], axis=0)])
    return lambda edges_s: mean_velocity(ends_s, total, edges_s)


def mostly_gaps(length_s: float, t_s: FloatArray) -> bool:
    """Return True if most windows of ``length_s`` would lie in gaps of the stamps, for example after a clock jump."""
    return bool(t_s[-1] - t_s[0] > length_s * max(MAX_WINDOWS, MAX_WINDOWS_PER_ROW * len(t_s)))


def common_edges(length_s: float, *stamps_s: FloatArray) -> FloatArray:
    """Return the edges of windows of the length ``length_s`` in the time interval that all streams cover.

    The returned array is empty if a stream has no rows, or if most windows would lie in gaps of a stream.
    """
    if not all(len(t_s) for t_s in stamps_s) or any(mostly_gaps(length_s, t_s) for t_s in stamps_s):
        return np.empty(0)
    begin_s, end_s = max(t_s[0] for t_s in stamps_s), min(t_s[-1] for t_s in stamps_s)
    return np.arange(begin_s, end_s, length_s)


def window_means(t_s: FloatArray, values: FloatArray, edges_s: FloatArray) -> FloatArray:
    """Return the means (n, k) of ``values`` (m, k) between n + 1 window edges."""
    return means_of(t_s, values)(edges_s)


def mean_velocity(t_s: FloatArray, places: FloatArray, edges_s: FloatArray) -> FloatArray:
    """Return the mean velocity (n, k) between n + 1 window edges, from linearly interpolated positions (m, k)."""
    at_edges = np.column_stack([np.interp(edges_s, t_s, column) for column in places.T])
    return np.asarray(np.diff(at_edges, axis=0) / np.diff(edges_s)[:, None], dtype=np.float64)


def mean_velocities(
    position: Position, t_s: FloatArray, values: FloatArray, length_s: float, *, are_places: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return the mean velocities (n, k) of the fixes and of a stream in common windows, for comparison.

    The two returned arrays are empty if there are too few rows.

    Args:
        position: the fixes, of which the first k axes are compared.
        t_s: (m,) stamps of the stream [s].
        values: (m, k) velocities or positions of the stream.
        length_s: length of the windows [s].
        are_places: whether ``values`` are positions.
    """
    fix_s, places = without_nan_rows(position.t_s, position.enu_m[:, : values.shape[1]])
    t_s, values = without_nan_rows(t_s, values)
    edges_s = common_edges(length_s, fix_s, t_s)
    if min(len(fix_s), len(t_s), len(edges_s)) <= MIN_WINDOWS:
        return np.empty((0, values.shape[1])), np.empty((0, values.shape[1]))
    mean = mean_velocity if are_places else window_means
    return mean_velocity(fix_s, places, edges_s), mean(t_s, values, edges_s)


def moving_speed_mps(position: Position) -> float:
    """Return the median speed between consecutive fixes of the moving vehicle, or NaN if the vehicle never moves."""
    t_s, places = without_nan_rows(position.t_s, position.enu_m[:, :2])
    speed = np.linalg.norm(np.diff(places, axis=0) / np.diff(t_s)[:, None], axis=1)
    return float(np.median(speed[speed > MIN_COURSE_MPS])) if (speed > MIN_COURSE_MPS).any() else float("nan")


def wheel_speeds(recording: Recording) -> tuple[FloatArray, FloatArray] | None:
    """Return times (n,) and forward speeds (n,) of a wheel or a body velocity, or None for too few rows."""
    velocity = recording.velocity
    if velocity is None or velocity.frame == "enu":
        return None
    t_s, mps = without_nan_rows(velocity.t_s, velocity.mps[:, :1])
    return (t_s, mps[:, 0]) if len(t_s) > MIN_WINDOWS else None


def track_windows(recording: Recording, length_s: float) -> WindowsAt | None:
    """Return the windows of track and IMU, or None if the fixes are too few or too far apart in time.

    The mean velocity in the interval i between two edges has the course chi_i and the norm s_i. Between the edges, the
    fixes are interpolated linearly. A window of the length T extends from the middle of one interval to the middle of
    the next interval::

        course change = chi_i+1 - chi_i,    forward = (s_i+1 - s_i)/T,    left = (s_i+1 + s_i)/2 (chi_i+1 - chi_i)/T
    """
    imu, position = recording.imu, recording.position
    if imu is None or position is None:
        return None
    t_s, places = without_nan_rows(position.t_s, position.enu_m[:, :2])
    if len(t_s) <= MIN_WINDOWS or np.median(np.diff(t_s)) > length_s * 1.01:
        return None
    edges_s = common_edges(length_s, t_s, imu.t_s)
    if len(edges_s) <= MIN_WINDOWS + 1:
        return None
    velocity_mps = mean_velocity(t_s, places, edges_s)
    speed_mps, course_rad = np.linalg.norm(velocity_mps, axis=1), np.arctan2(velocity_mps[:, 1], velocity_mps[:, 0])
    change_rad = np.asarray((np.diff(course_rad) + np.pi) % (2 * np.pi) - np.pi, dtype=np.float64)
    use = (np.minimum(speed_mps[1:], speed_mps[:-1]) > MIN_COURSE_MPS) & (np.abs(change_rad) < _MAX_ANGLE_RAD)
    return _windows(imu, edges_s, speed_mps, use, change_rad)


def wheel_windows(recording: Recording, length_s: float) -> WindowsAt | None:
    """Return the windows of a wheel speed and the IMU, or None if there are too few measurements.

    The mean speed of the wheel in the interval i between two edges is s_i. A window of the length T extends from the
    middle of one interval to the middle of the next interval::

        forward = (s_i+1 - s_i)/T,    left = (s_i+1 + s_i)/2 w_z
    """
    imu, wheel = recording.imu, wheel_speeds(recording)
    if imu is None or wheel is None or np.median(np.diff(wheel[0])) > length_s:
        return None
    t_s, mps = wheel
    edges_s = common_edges(length_s, t_s, imu.t_s)
    if len(edges_s) <= MIN_WINDOWS + 2:
        return None
    speed_mps = window_means(t_s, mps[:, None], edges_s)[:, 0]
    return _windows(imu, edges_s, speed_mps, np.ones(len(speed_mps) - 1, dtype=bool))


def _windows(
    imu: Imu, edges_s: FloatArray, speed_mps: FloatArray, use: BoolArray, change_rad: FloatArray | None = None
) -> WindowsAt:
    """Return the windows for the speeds between edges. If ``change_rad`` is None, the gyro gives the course change."""
    length_s, middles_s = edges_s[1] - edges_s[0], 0.5 * (edges_s[1:] + edges_s[:-1])
    means = means_of(imu.t_s, np.hstack([imu.gyro_radps, imu.accel_mps2]))
    forward, mean_mps = np.diff(speed_mps) / length_s, 0.5 * (speed_mps[1:] + speed_mps[:-1])

    def at(late_s: float) -> Windows | None:
        stamps_s = middles_s + late_s
        rows = use & (stamps_s[:-1] > imu.t_s[0]) & (stamps_s[1:] < imu.t_s[-1])
        if rows.sum() < MIN_WINDOWS:
            return None
        both = means(stamps_s)
        change = both[:, 2] * length_s if change_rad is None else change_rad
        plane = np.column_stack([forward, mean_mps * change / length_s])
        return Windows(change[rows], plane[rows], both[rows, :3] * length_s, both[rows, 3:])

    return at


def over_lengths(
    make: Callable[[Recording, float], WindowsAt | None], recording: Recording, late_s: float = 0.0
) -> dict[float, Windows]:
    """Return the windows for each window length [s] with enough windows, as a dictionary by the length."""
    windows = {length_s: at(late_s) for length_s in _LENGTHS_S if (at := make(recording, length_s)) is not None}
    return {length_s: one for length_s, one in windows.items() if one is not None}


def correlation_of(a: FloatArray, b: FloatArray) -> float:
    """Return the correlation of two series (n, k) or (n,) over all centred columns, or 0 if a series is constant."""
    return cosine(*(x - x.mean(axis=0) for x in (a.reshape(len(a), -1), b.reshape(len(b), -1))))


def cosine(a: FloatArray, b: FloatArray) -> float:
    """Return the cosine of the angle between two series (n, k), or 0 if a series is zero or empty."""
    size = float(np.sqrt(np.sum(a**2) * np.sum(b**2)))
    return float(np.sum(a * b)) / size if size > 0 else 0.0


def strength(correlation: float, rows: int) -> float:
    """Return the significance of a correlation, in standard deviations from zero: Fisher's atanh(r) sqrt(n - 3)."""
    return float(np.arctanh(np.clip(correlation, -0.9999, 0.9999)) * np.sqrt(max(rows - 3, 0)))


def slope(of: FloatArray, on: FloatArray) -> float:
    """Return the slope b of the least-squares fit ``of`` = b ``on`` + constant, or 0 if ``on`` is constant."""
    of, on = of - of.mean(axis=0), on - on.mean(axis=0)
    size = float(np.sum(on**2))
    return float(np.sum(of * on)) / size if size > 0 else 0.0


class Turning(NamedTuple):
    """Comparison of a turn rate with the gyro.

    Attributes:
        basis: the source of the turn rate, for example "the track".
        correlation: correlation of the turn rate with the gyro.
        factor: ratio of the turn rate to the angular rate of the gyro.
        strength: significance of the correlation, in standard deviations from zero.
        length_s: length of the compared windows [s].
    """

    basis: str
    correlation: float
    factor: float
    strength: float
    length_s: float

    def is_about(self, factor: float) -> bool:
        """Return True if the absolute ratio of the turn rate to the gyro is ``factor``, within a tolerance."""
        return 1 / MAX_RATE_RATIO < abs(self.factor) / factor < MAX_RATE_RATIO


def sure_turnings(recording: Recording) -> list[Turning]:
    """Return the turn rates of track and gravity that have a significant correlation (of either sign) with the gyro."""
    if recording.imu is None:
        return []
    turnings = (turning_track(recording), turning_gravity(recording.imu))
    return [turning for turning in turnings if turning and abs(turning.strength) >= MIN_STRENGTH]


def turning_track(recording: Recording) -> Turning | None:
    """Compare the course of the track with the z axis of the gyro, for the most significant window length."""
    turnings = [
        _turning("the track", windows.course_change_rad, windows.turn_rad[:, 2], length_s)
        for length_s, windows in over_lengths(track_windows, recording).items()
        if windows.turn_rad[:, 2].any()
    ]
    return max(turnings, key=lambda turning: abs(turning.strength), default=None)


def turning_gravity(imu: Imu) -> Turning | None:
    """Compare the rotation of the specific force, which is mostly gravity, with the gyro.

    The direction u = f/|f| of the specific force and the angular rate omega are averaged over windows of 1 and 2 s. If
    gravity is the dominant force, the direction follows the rotation::

        du/dt = -omega x u
    """
    turnings = []
    for length_s in GRAVITY_WINDOWS_S if imu.gyro_radps.any() else ():
        edges_s = common_edges(length_s, imu.t_s)
        if len(edges_s) < 10:
            continue
        force, rate = (window_means(imu.t_s, values, edges_s) for values in (imu.accel_mps2, imu.gyro_radps))
        up = force / np.maximum(np.linalg.norm(force, axis=1), MIN_FORCE_MPS2)[:, None]
        expected = -np.cross(0.5 * (rate[1:] + rate[:-1]), 0.5 * (up[1:] + up[:-1]))
        turnings.append(_turning("gravity", np.diff(up, axis=0) / length_s, expected, length_s))
    return max(turnings, key=lambda turning: abs(turning.strength), default=None)


def _turning(basis: str, measured: FloatArray, expected: FloatArray, length_s: float) -> Turning:
    correlation = correlation_of(measured, expected)
    return Turning(basis, correlation, slope(measured, expected), strength(correlation, len(measured)), length_s)
