"""What the doctor weighs: an IMU beside a track or a wheel over the same windows, and how strongly two series agree."""

import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.recording import Imu, Position, Recording

_LENGTHS_S = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Noise asks for long windows, a winding track for short ones: each check takes those that say most."""

SLOWEST_MPS = 0.5
"""Below, a track of fixes has no course."""

_MAX_ANGLE_RAD = 1.5
"""A course that changes by more within a window may as well have turned the other way, or be noise."""

MIN_WINDOWS = 20

DEG_PER_RAD = float(np.degrees(1.0))

WITHIN = 2.5
"""A turning may be so many times faster or slower than expected: windows, vibration and noise bend it."""

GRAVITY_WINDOWS_S = (1.0, 2.0)
"""Over shorter ones a force turns with vibration."""

MIN_FORCE_MPS2 = 1e-6
"""A sensor that says nothing has no direction."""

MAX_WINDOWS, MAX_WINDOWS_PER_ROW = 100_000, 10
"""So many windows any recording may have, and a longer one for each of its rows: more are empty."""

SURE = 5.0
"""So many standard deviations from none is a relation, among the many that are tried."""


MISTAKES = tomllib.loads((Path(__file__).parent / "mistakes.toml").read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Diagnosis:
    """One mistake in a recording.

    Attributes:
        name: short, for tables: "accelerometer in g".
        measured: what was measured, with its unit.
        sentence: what it means.
        remedy: the parameter that would mend it.
    """

    name: str
    measured: str
    sentence: str
    remedy: str

    def __str__(self) -> str:
        """Return all in a line that a person reads."""
        return f"{self.sentence}: {self.measured}. {self.remedy}."


def diagnosis(mistake: str, measured: str, **parts: object) -> Diagnosis:
    """Return one of `MISTAKES`, whose texts have ``parts`` in them, with what was measured."""
    return Diagnosis(measured=measured, **{key: text.format(**parts) for key, text in MISTAKES[mistake].items()})


@dataclass(frozen=True, eq=False)
class Windows:
    """What the track or a wheel says, and what the IMU says of the same windows.

    Attributes:
        course_change_rad: (n,) of the track within each window, to the left; of a wheel: the gyro's.
        plane_mps2: (n, 2) acceleration of the vehicle, forward and left.
        turn_rad: (n, 3) the gyro's integral.
        force_mps2: (n, 3) the mean specific force.
    """

    course_change_rad: FloatArray
    plane_mps2: FloatArray
    turn_rad: FloatArray
    force_mps2: FloatArray

    def __len__(self) -> int:
        """Return how many windows there are."""
        return len(self.course_change_rad)


WindowsAt = Callable[[float], Windows | None]
"""The windows, the IMU's stamps less so many seconds being right; None with fewer than 20 in motion."""


def without_nan_rows(t_s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the rows whose values (n, k) are all there."""
    rows = np.isfinite(values).all(axis=1)
    return t_s[rows], values[rows]


def means_of(t_s: FloatArray, values: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Return a function of n + 1 edges that gives (n, k) means between them; each value is the mean up to its stamp."""
    ends_s = np.concatenate([[t_s[0] - np.median(np.diff(t_s))], t_s])
    total = np.vstack([np.zeros(values.shape[1]), np.cumsum(values * np.diff(ends_s)[:, None], axis=0)])
    return lambda edges_s: mean_velocity(ends_s, total, edges_s)


def mostly_gaps(length_s: float, t_s: FloatArray) -> bool:
    """Whether most windows of ``length_s`` would lie in gaps of the stamps, as where a clock was set under way."""
    return bool(t_s[-1] - t_s[0] > length_s * max(MAX_WINDOWS, MAX_WINDOWS_PER_ROW * len(t_s)))


def common_edges(length_s: float, *stamps_s: FloatArray) -> FloatArray:
    """Return edges ``length_s`` apart in the time that all of the stamps have in common.

    There are none where a stream is empty or `mostly_gaps`.
    """
    if not all(len(t_s) for t_s in stamps_s) or any(mostly_gaps(length_s, t_s) for t_s in stamps_s):
        return np.empty(0)
    begin_s, end_s = max(t_s[0] for t_s in stamps_s), min(t_s[-1] for t_s in stamps_s)
    return np.arange(begin_s, end_s, length_s)


def window_means(t_s: FloatArray, values: FloatArray, edges_s: FloatArray) -> FloatArray:
    """Return (n, k) the means of values (m, k) between n + 1 edges."""
    return means_of(t_s, values)(edges_s)


def mean_velocity(t_s: FloatArray, places: FloatArray, edges_s: FloatArray) -> FloatArray:
    """Return (n, k) the velocity from edge to edge, places (m, k) taken linearly between their stamps."""
    at_edges = np.column_stack([np.interp(edges_s, t_s, column) for column in places.T])
    return np.asarray(np.diff(at_edges, axis=0) / np.diff(edges_s)[:, None], dtype=np.float64)


def moving_speed_mps(position: Position) -> float:
    """Return the median speed from fix to fix where it moves; NaN where it never does."""
    t_s, places = without_nan_rows(position.t_s, position.enu_m[:, :2])
    speed = np.linalg.norm(np.diff(places, axis=0) / np.diff(t_s)[:, None], axis=1)
    return float(np.median(speed[speed > SLOWEST_MPS])) if (speed > SLOWEST_MPS).any() else float("nan")


def wheel_speeds(recording: Recording) -> tuple[FloatArray, FloatArray] | None:
    """Return times (n,) and forward speeds (n,) of a wheel or along the body; None where there are too few."""
    velocity = recording.velocity
    if velocity is None or velocity.frame == "enu":
        return None
    t_s, mps = without_nan_rows(velocity.t_s, velocity.mps[:, :1])
    return (t_s, mps[:, 0]) if len(t_s) > MIN_WINDOWS else None


def track_windows(recording: Recording, length_s: float) -> WindowsAt | None:
    """Return the windows of an IMU and fixes; None where fixes are further apart than a window, or too few.

    With v_i the mean velocity from edge to edge of the fixes, taken linearly, chi_i its course and s_i its size, a
    window goes from the middle of one interval T to that of the next::

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
    use = (np.minimum(speed_mps[1:], speed_mps[:-1]) > SLOWEST_MPS) & (np.abs(change_rad) < _MAX_ANGLE_RAD)
    return _windows(imu, edges_s, speed_mps, use, change_rad)


def wheel_windows(recording: Recording, length_s: float) -> WindowsAt | None:
    """Return what a wheel, the gyro's z axis and the accelerometer say of the same windows; None where too few.

    With s_i the mean speed over an interval T, a window goes from the middle of one to that of the next::

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
    """Return the windows of the speeds between edges; without a course its change is the gyro's."""
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
    """Return the windows of each length for which there are enough."""
    windows = {length_s: at(late_s) for length_s in _LENGTHS_S if (at := make(recording, length_s)) is not None}
    return {length_s: one for length_s, one in windows.items() if one is not None}


def correlation_of(a: FloatArray, b: FloatArray) -> float:
    """Return that of all columns of (n, k) or (n,) together, each less its mean; 0 where one does not change."""
    a, b = (x - x.mean(axis=0) for x in (a.reshape(len(a), -1), b.reshape(len(b), -1)))
    size = float(np.sqrt(np.sum(a**2) * np.sum(b**2)))
    return float(np.sum(a * b)) / size if size > 0 else 0.0


def strength(correlation: float, rows: int) -> float:
    """Return how many standard deviations from zero a correlation is: Fisher's atanh(r) sqrt(n - 3)."""
    return float(np.arctanh(np.clip(correlation, -0.9999, 0.9999)) * np.sqrt(max(rows - 3, 0)))


def slope(of: FloatArray, on: FloatArray) -> float:
    """Return the factor b of the least squares ``of`` = b ``on`` + a constant on each axis; 0 without any change."""
    of, on = of - of.mean(axis=0), on - on.mean(axis=0)
    size = float(np.sum(on**2))
    return float(np.sum(of * on)) / size if size > 0 else 0.0


class Turning(NamedTuple):
    """A turning that was measured beside the gyro.

    Attributes:
        basis: what turns.
        correlation: with what the gyro says.
        factor: how many times as fast as that it turns.
        strength: of the correlation, in standard deviations from none.
        length_s: of the windows.
    """

    basis: str
    correlation: float
    factor: float
    strength: float
    length_s: float

    def is_about(self, factor: float) -> bool:
        """Whether it turns about so many times as fast, whichever way."""
        return 1 / WITHIN < abs(self.factor) / factor < WITHIN


def sure_turnings(recording: Recording) -> list[Turning]:
    """Return what surely turns with the gyro, or against it: the track, gravity, or both."""
    if recording.imu is None:
        return []
    turnings = (turning_track(recording), turning_gravity(recording.imu))
    return [turning for turning in turnings if turning and abs(turning.strength) >= SURE]


def turning_track(recording: Recording) -> Turning | None:
    """Return how the course of the track turns with the gyro's z axis, over the windows that say most."""
    turnings = [
        _turning("the track", windows.course_change_rad, windows.turn_rad[:, 2], length_s)
        for length_s, windows in over_lengths(track_windows, recording).items()
        if windows.turn_rad[:, 2].any()
    ]
    return max(turnings, key=lambda turning: abs(turning.strength), default=None)


def turning_gravity(imu: Imu) -> Turning | None:
    """Return how the direction of the specific force turns with the gyro.

    With u = f/|f|, both averaged over windows of 1 and 2 s::

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


def _turning(basis: str, turned: FloatArray, expected: FloatArray, length_s: float) -> Turning:
    correlation = correlation_of(turned, expected)
    return Turning(basis, correlation, slope(turned, expected), strength(correlation, len(turned)), length_s)
