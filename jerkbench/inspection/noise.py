"""A rest of the IMU, its noise there, and the grade of sensor that it suggests."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray
from jerkbench.inspection.evidence import window_means, without_nan_rows
from jerkbench.recording import GRAVITY_MPS2, Imu, Recording
from jerkbench.simulation.imu import ALLAN_FLOOR, GRADES

SHORTEST_REST_S = 5.0
POINTS = 40
LONGEST_PART = 0.25
"""Averages over more than this part of the rest are too few to say anything."""

WHITE_S = (0.05, 1.0)
"""The averaging times for the white noise: below the drift, above a resonance of the mounting."""

FLOOR_NEEDS_S = 60.0
"""A rest that is shorter does not reach the floor of the Allan deviation."""

WINDOW_S = 0.5
"""A rest is looked for in windows of so long."""

QUIET_RADPS, QUIET_MPS2 = 0.01, 0.1
"""Below these (root of the sum of the axes' variances) a window may be a rest, whatever the others are."""

QUIET_PART, LOUD = 0.2, 0.8
"""Or below this part of the windows that are louder than so many: an engine idles."""

TURNS_RADPS = 0.03
"""At rest a gyro shows its bias, which is smaller."""

MOVES_MPS = 0.3
"""Fixes or velocities that move by more contradict a rest."""


class Rest(NamedTuple):
    """A rest of the IMU.

    Attributes:
        begin_s: its begin.
        end_s: its end.
        stated: whether the recording says so; else it was found in the IMU.
    """

    begin_s: float
    end_s: float
    stated: bool

    def rows_of(self, t_s: FloatArray, values: FloatArray) -> FloatArray:
        """Return the rows of values within the rest."""
        return values[(t_s >= self.begin_s) & (t_s <= self.end_s)]


@dataclass(frozen=True, eq=False)
class RestNoise:
    """The noise of an IMU, measured at rest.

    Attributes:
        rest: where it was measured.
        tau_s: (k,) averaging times.
        gyro_radps: (k, 3) Allan deviation.
        accel_mps2: (k, 3) Allan deviation.
        angle_random_walk_deg_per_sqrt_h: the largest of the axes.
        velocity_random_walk_mps_per_sqrt_h: the largest of the axes.
        gyro_instability_deg_per_h: lowest Allan deviation over `ALLAN_FLOOR`, the largest of the axes; NaN: too short.
        accel_instability_mg: likewise.
        grade: the preset of the simulator's IMU (``dataset.imu``) whose white noise is nearest.
    """

    rest: Rest
    tau_s: FloatArray
    gyro_radps: FloatArray
    accel_mps2: FloatArray
    angle_random_walk_deg_per_sqrt_h: float
    velocity_random_walk_mps_per_sqrt_h: float
    gyro_instability_deg_per_h: float
    accel_instability_mg: float
    grade: str


def stated_rest(recording: Recording) -> Rest | None:
    """Return the rest at the start that the recording states; None: it is shorter than 5 s."""
    begin_s = float(recording.clock_s[0])
    long = recording.static_start_s >= SHORTEST_REST_S
    return Rest(begin_s, begin_s + recording.static_start_s, stated=True) if long else None


def longest_rest(recording: Recording) -> Rest | None:
    """Return the rest that the recording states, or else the longest that its IMU shows; None: none of 5 s.

    A window of half a second may be a rest where gyro and accelerometer scatter little and the gyro hardly turns.
    Fixes and velocities may contradict: a smooth road is quiet, too.
    """
    imu, stated = recording.imu, stated_rest(recording)
    edges_s = np.empty(0) if imu is None else np.arange(imu.t_s[0], imu.t_s[-1], WINDOW_S)
    if imu is None or stated or len(edges_s) < 2:
        return stated
    steps = np.diff(np.concatenate([[False], _quiet(imu, edges_s), [False]]).astype(int))
    rests = [  # without its first and last window, in which the motion may end and begin
        Rest(float(edges_s[first + (first > 0)]), float(edges_s[last - (last < len(edges_s) - 1)]), stated=False)
        for first, last in zip(np.flatnonzero(steps == 1), np.flatnonzero(steps == -1), strict=True)
    ]
    long = [rest for rest in rests if rest.end_s - rest.begin_s >= SHORTEST_REST_S and not _moves(recording, rest)]
    return max(long, key=lambda rest: rest.end_s - rest.begin_s, default=None)


def _quiet(imu: Imu, edges_s: FloatArray) -> BoolArray:
    """Whether each window between edges may be one of a rest."""
    counts = np.diff(np.searchsorted(imu.t_s, edges_s))
    mean = window_means(imu.t_s, imu.gyro_radps, edges_s)
    quiet = (counts > 0.5 * np.median(counts)) & (np.linalg.norm(mean, axis=1) < TURNS_RADPS)
    for values, least in ((imu.gyro_radps, QUIET_RADPS), (imu.accel_mps2, QUIET_MPS2)):
        centred = values - values.mean(axis=0)
        variance = window_means(imu.t_s, centred**2, edges_s) - window_means(imu.t_s, centred, edges_s) ** 2
        scatter = np.sqrt(np.maximum(variance, 0.0).sum(axis=1))
        quiet &= scatter < max(least, QUIET_PART * float(np.quantile(scatter, LOUD)))
    return np.asarray(quiet)


def _moves(recording: Recording, rest: Rest) -> bool:
    """Whether velocities or fixes move during a rest."""
    position, velocity = recording.position, recording.velocity
    if velocity is not None:
        mps = rest.rows_of(*without_nan_rows(velocity.t_s, velocity.mps[:, : 2 if velocity.frame == "enu" else 1]))
        if len(mps) and np.linalg.norm(np.median(mps, axis=0)) > MOVES_MPS:
            return True
    if position is None:
        return False
    places = rest.rows_of(*without_nan_rows(position.t_s, position.enu_m[:, :2]))
    third = max(1, len(places) // 3)
    moved_m = np.linalg.norm(places[-third:].mean(axis=0) - places[:third].mean(axis=0)) if len(places) > 1 else 0.0
    return bool(moved_m > MOVES_MPS * (rest.end_s - rest.begin_s))


def rest_noise(recording: Recording, rest: Rest | None = None) -> RestNoise | None:
    """Return what a rest tells, if None the one that the recording states; None where that is shorter than 5 s.

    White noise N is the mean of adev(tau) sqrt(tau) over tau from 0.05 to 1 s. An engine that idles counts as noise.
    """
    imu, rest = recording.imu, rest or stated_rest(recording)
    if imu is None or rest is None:
        return None
    rows = (imu.t_s >= rest.begin_s) & (imu.t_s < rest.end_s)
    tau_s, gyro = allan_deviation(imu.gyro_radps[rows], imu.nominal_interval_s)
    _, accel = allan_deviation(imu.accel_mps2[rows], imu.nominal_interval_s)
    walks = np.degrees(_white(tau_s, gyro)) * 60.0, _white(tau_s, accel) * 60.0
    floors = np.degrees(_floor(gyro)) * 3600.0, _floor(accel) / GRAVITY_MPS2 * 1e3
    if rest.end_s - rest.begin_s < FLOOR_NEEDS_S:
        floors = float("nan"), float("nan")
    return RestNoise(rest, tau_s, gyro, accel, *walks, *floors, nearest_grade(*walks))


def allan_deviation(samples: FloatArray, interval_s: float) -> tuple[FloatArray, FloatArray]:
    """Return averaging times (k,) and the overlapping Allan deviation (k, m) of samples (n, m).

    With theta the running integral and tau = j dt::

        adev(tau)^2 = mean over i of (theta_{i+2j} - 2 theta_{i+j} + theta_i)^2 / (2 tau^2)

    Source: IEEE Std 952, annex C.
    """
    theta = np.vstack([np.zeros(samples.shape[1]), np.cumsum(samples * interval_s, axis=0)])
    longest = max(1, int(LONGEST_PART * len(samples)))
    steps = np.unique(np.round(np.geomspace(1, longest, POINTS)).astype(np.int64))
    rows = [np.sqrt(((theta[2 * j :] - 2 * theta[j:-j] + theta[: -2 * j]) ** 2).mean(axis=0) / 2) for j in steps]
    tau_s = np.asarray(steps * interval_s, dtype=np.float64)
    return tau_s, np.array(rows) / tau_s[:, None]


def nearest_grade(angle_random_walk_deg_per_sqrt_h: float, velocity_random_walk_mps_per_sqrt_h: float) -> str:
    """Return the grade whose two random walks are nearest, as ratios."""
    measured = [angle_random_walk_deg_per_sqrt_h, velocity_random_walk_mps_per_sqrt_h]
    walks = [(g.angle_random_walk_deg_per_sqrt_h, g.velocity_random_walk_mps_per_sqrt_h) for g in GRADES.values()]
    with np.errstate(divide="ignore"):
        away = np.hypot(*np.log(np.array(measured) / walks).T)
    return list(GRADES)[int(np.argmin(away))]


def _white(tau_s: FloatArray, deviation: FloatArray) -> float:
    """N, the largest of the axes."""
    rows = (tau_s >= WHITE_S[0]) & (tau_s <= WHITE_S[1])
    rows = rows if rows.any() else np.ones(len(tau_s), dtype=bool)
    return float((deviation[rows] * np.sqrt(tau_s[rows])[:, None]).mean(axis=0).max())


def _floor(deviation: FloatArray) -> float:
    return float(deviation.min(axis=0).max()) / ALLAN_FLOOR
