"""A rest of the IMU and its noise there; the real errors of a receiver against its stated sigmas."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, linear_at
from jerkbench.inspection.evidence import (
    Diagnosis,
    common_edges,
    correlation_of,
    diagnosis,
    slope,
    window_means,
    without_nan_rows,
)
from jerkbench.recording import GRAVITY_MPS2, Imu, Position, Recording
from jerkbench.simulation.imu import ALLAN_FLOOR, GRADES

MIN_REST_S = 5.0
_POINTS = 40
MAX_AVERAGED_FRACTION = 0.25
"""Averages over more than this part of the rest are too few to say anything."""

WHITE_S = (0.05, 1.0)
"""The averaging times for the white noise: below the drift, above a resonance of the mounting."""

FLOOR_NEEDS_S = 60.0
"""A rest that is shorter does not reach the floor of the Allan deviation."""

_WINDOW_S = 0.5
"""A rest is looked for in windows of so long."""

QUIET_RADPS, QUIET_MPS2 = 0.01, 0.1
"""Below these (root of the sum of the axes' variances) a window may be a rest, whatever the others are."""

QUIET_PART, LOUD = 0.2, 0.8
"""Or below this part of the windows that are louder than so many: an engine idles."""

TURNS_RADPS = 0.03
"""At rest a gyro shows its bias, which is smaller."""

_MOVES_MPS = 0.3
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


class RestNoise(NamedTuple):
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
    long = recording.static_start_s >= MIN_REST_S
    return Rest(begin_s, begin_s + recording.static_start_s, stated=True) if long else None


def longest_rest(recording: Recording) -> Rest | None:
    """Return the rest that the recording states, or else the longest that its IMU shows; None: none of 5 s.

    A window of half a second may be a rest where gyro and accelerometer scatter little and the gyro hardly turns.
    Fixes and velocities may contradict: a smooth road is quiet, too.
    """
    imu, stated = recording.imu, stated_rest(recording)
    edges_s = np.empty(0) if imu is None else common_edges(_WINDOW_S, imu.t_s)
    if imu is None or stated or len(edges_s) < 2:
        return stated
    steps = np.diff(np.concatenate([[False], _quiet(imu, edges_s), [False]]).astype(int))
    rests = [  # without its first and last window, in which the motion may end and begin
        Rest(float(edges_s[first + (first > 0)]), float(edges_s[last - (last < len(edges_s) - 1)]), stated=False)
        for first, last in zip(np.flatnonzero(steps == 1), np.flatnonzero(steps == -1), strict=True)
    ]
    long = [rest for rest in rests if rest.end_s - rest.begin_s >= MIN_REST_S and not _moves(recording, rest)]
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
        if len(mps) and np.linalg.norm(np.median(mps, axis=0)) > _MOVES_MPS:
            return True
    if position is None:
        return False
    places = rest.rows_of(*without_nan_rows(position.t_s, position.enu_m[:, :2]))
    third = max(1, len(places) // 3)
    moved_m = np.linalg.norm(places[-third:].mean(axis=0) - places[:third].mean(axis=0)) if len(places) > 1 else 0.0
    return bool(moved_m > _MOVES_MPS * (rest.end_s - rest.begin_s))


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
    longest = max(1, int(MAX_AVERAGED_FRACTION * len(samples)))
    steps = np.unique(np.round(np.geomspace(1, longest, _POINTS)).astype(np.int64))
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


_MIN_ROWS = 10

MEDIAN_OF_SQUARE = 0.455
"""Median of chi-square with one degree of freedom."""

REST, _REFERENCE = "scatter at rest", "error against the reference"

_NEAR_S = 0.5
"""Over a longer interval of the reference a straight line says little."""

MIN_RATIO = 4.0
"""A receiver among towers errs 3.2 times as much as it says, in the middle of its errors; a mistake is more."""

MIN_SPREAD = 2.0
"""About its median a receiver among towers errs 1.2 times as much as it says; this is less than a mistake by 10 leaves
of sigmas that are four times too large."""

MAX_FIX_GAP_S = 1.1

MIDDLE_ROWS = 30
"""The middle of fewer errors is no scale."""

FAST_SHARE = 1.5
"""Variance of x_i - (x_i-1 + x_i+1)/2 of white noise with variance 1."""

WHITE = -0.3
"""Fast changes of white noise correlate by -2/3 from row to row, those of motion hardly or by more than 0.
Of few rows the correlation is known to one over their root."""

JITTER, AT_REST = "the jitter from row to row", "the scatter at rest"
_MEDIAN = "the median error against the reference"
SPREAD = "the middle of the error against the reference, about its median"
BY_REFERENCE = (_MEDIAN, SPREAD)
"""What the errors are measured by."""

SHIFTS = range(-2, 3)
"""By so many rows a velocity may be older or younger than the slope that it was computed from."""


class Sigma(NamedTuple):
    """One standard deviation of a stream, stated and real.

    Attributes:
        stream: "position" or "velocity".
        unit: "m" or "m/s".
        basis: where the real one comes from: the scatter at rest, which a slow error does not show in, or the error
            against the reference.
        stated: (3,) root of the mean stated variance on each axis.
        real: (3,) root mean square on each axis.
        ratio: root of the mean of e' R^-1 e an axis; 1: as stated, 2: twice as large.
        median_ratio: the same of the middle of the errors east and north: no tail counts.
        rows: over how many.
    """

    stream: str
    unit: str
    basis: str
    stated: FloatArray
    real: FloatArray
    ratio: float
    median_ratio: float
    rows: int


def stated_against_real_sigma(recording: Recording, rest: Rest | None = None) -> list[Sigma]:
    """Return what can be told of position and ENU velocity: at rest, and against the reference.

    A reference whose places are the fixes themselves says nothing of them; it is left out. The reference is taken
    linearly between its stamps, where these are no further apart than 0.5 s. A row need not have all axes.

    Args:
        recording: the recording.
        rest: where it stands still; None: at the start, for as long as the recording states.
    """
    sigmas = []
    begin_s, end_s = (0.0, recording.static_start_s) if rest is None else rest[:2]
    for name, unit, t_s, values, covariance in stated_streams(recording):
        still = (t_s >= begin_s) & (t_s < end_s)
        if _enough(values[still]):
            centre = np.nanmean(values[still], axis=0) if name == "position" else np.zeros(3)
            sigmas.append(_sigma(name, unit, REST, values[still] - centre, covariance[still]))
        error = values - truth_at(recording, name, t_s)
        inside = np.isfinite(error).any(axis=1)
        if _enough(error[inside]) and (np.nan_to_num(error) != 0).any():
            sigmas.append(_sigma(name, unit, _REFERENCE, error[inside], covariance[inside]))
    return sigmas


def _enough(values: FloatArray) -> bool:
    """Whether each axis is there often enough."""
    return bool((np.isfinite(values).sum(axis=0) >= _MIN_ROWS).all())


def stated_streams(recording: Recording) -> list[tuple[str, str, FloatArray, FloatArray, FloatArray]]:
    """Return name, unit, times (m,), values (m, 3) and covariances (m, 3, 3) of position and ENU velocity."""
    p, v = recording.position, recording.velocity
    streams = [] if p is None else [("position", "m", p.t_s, p.enu_m, p.covariance_m2)]
    if v is not None and v.frame == "enu":
        streams.append(("velocity", "m/s", v.t_s, v.mps, v.covariance_m2ps2))
    return streams


def truth_at(recording: Recording, stream: str, t_s: FloatArray, near_s: float = _NEAR_S) -> FloatArray:
    """Return (m, 3) the reference at ``t_s``; NaN where it is not known near."""
    reference = recording.reference
    values = reference.enu_m if stream == "position" else reference.velocity_mps
    if values is None or len(reference.t_s) < 2:
        return np.full((len(t_s), 3), np.nan)
    return linear_at(reference.t_s, values, t_s, near_s)


def _sigma(name: str, unit: str, basis: str, error: FloatArray, covariance: FloatArray) -> Sigma:
    """Of errors (k, 3), NaN where an axis was not measured."""
    measured = np.isfinite(error)
    filled, both_measured = np.where(measured, error, 0.0), measured[:, :, None] & measured[:, None, :]
    weighed = np.linalg.solve(np.where(both_measured, covariance, np.eye(3)), filled[:, :, None])[:, :, 0]
    squares = np.einsum("ki,ki->k", filled, weighed)
    variances = np.where(measured, np.diagonal(covariance, axis1=1, axis2=2), np.nan)
    stated, real = (np.sqrt(np.nanmean(values, axis=0)) for values in (variances, error**2))
    ratio, median = float(np.sqrt(squares.sum() / measured.sum())), _middle(error[:, :2], np.sqrt(variances[:, :2]))
    return Sigma(name, unit, basis, stated, real, ratio, median, len(error))


def _middle(error: FloatArray, sigmas: FloatArray) -> float:
    """The middle of errors against their sigmas; 1: as stated."""
    return float(np.sqrt(np.nanmedian((error / sigmas) ** 2) / MEDIAN_OF_SQUARE))


def understated_noise(recording: Recording, *, reference: bool = True) -> list[Diagnosis]:
    """Return the streams that err at least four times as much as they say, fixes about their offset at least twice.

    By the scatter at rest, by the error against a reference, and by the jitter from row to row; of errors with a long
    tail only the middle counts, for a false fix is no matter of scale.

    Args:
        recording: the recording.
        reference: whether the reference may be asked: its axes are those of the fixes.
    """
    ratios = [*_jitter(recording, white=True), *(_ratio(sigma) for sigma in stated_against_real_sigma(recording))]
    least = [(entry, MIN_RATIO) for entry in ratios] + [(entry, MIN_SPREAD) for entry in _spread(recording)]
    worst: dict[str, tuple[float, str]] = {}
    for (stream, ratio, basis), limit in least:
        asked = reference or basis not in BY_REFERENCE
        if asked and ratio >= limit and ratio > worst.get(stream, (0.0, ""))[0]:
            worst[stream] = ratio, basis
    return [
        diagnosis("understated", measured, stream=stream, ratio=ratio, square=ratio**2)
        for stream, (ratio, basis) in worst.items()
        for measured in [f"{basis} is {ratio:.1f} times as large as stated"]
    ]


def overstated_noise(recording: Recording, rest: Rest | None) -> Iterator[str]:
    """Tell which stated sigmas are at least four times as large as the errors that show; that is never sure.

    By the error against the reference, or else the scatter at rest, or else the jitter from row to row.
    """
    sigmas = sorted(stated_against_real_sigma(recording, rest), key=lambda sigma: sigma.basis == REST)
    ratios = [*(_ratio(sigma) for sigma in sigmas), *_spread(recording), *_jitter(recording)]
    for stream, unit, _, values, covariance in stated_streams(recording):
        found = [(ratio, basis) for name, ratio, basis in ratios if name == stream and ratio > 0]
        against = [pair for pair in found if pair[1] in BY_REFERENCE]
        ratio, basis = max(against or found[:1], default=(1.0, ""))
        if ratio > 1 / MIN_RATIO:
            continue
        deviations = np.where(np.isfinite(values), np.sqrt(np.diagonal(covariance, axis1=1, axis2=2)), np.nan)
        stated = float(np.nanmedian(deviations[:, :2]))
        slow = "" if against else " An error that changes slowly does not show in that, so they may be right."
        yield (
            f"The standard deviations of {stream} may be too large: {stated:.3g} {unit} is stated, {stated * ratio:.2g}"
            f" {unit} measured, {1 / ratio:.3g} times less ({basis}).{slow} To correct them, scale them by {ratio:.2g}:"
            f" r_scale.{stream}={ratio**2:.2g}."
        )


def _spread(recording: Recording) -> Iterator[tuple[str, float, str]]:
    """The middle of the fixes' errors about their median against their sigmas, all axes together.

    The reference is taken linearly between stamps a second apart, too: an offset, which a reference may have, is gone,
    and half a metre of a bend within a second is nothing to the sigma of a receiver at 1 Hz.
    """
    position = recording.position
    if position is None or len(recording.reference.t_s) < MIDDLE_ROWS:
        return
    error = position.enu_m - truth_at(recording, "position", position.t_s, MAX_FIX_GAP_S)
    rows = np.isfinite(error).all(axis=1)
    if rows.sum() >= MIDDLE_ROWS and error[rows].any():
        sigmas = np.sqrt(np.diagonal(position.covariance_m2[rows], axis1=1, axis2=2))
        ratio = _middle(error[rows] - np.median(error[rows], axis=0), sigmas)
        yield "position", ratio, SPREAD


def _ratio(sigma: Sigma) -> tuple[str, float, str]:
    ratio, basis = (sigma.ratio, AT_REST) if sigma.basis == REST else (sigma.median_ratio, _MEDIAN)
    return sigma.stream, ratio, basis


def _jitter(recording: Recording, *, white: bool = False) -> Iterator[tuple[str, float, str]]:
    """Of each stream the middle of |x_i - (x_i-1 + x_i+1)/2| against its sigma, east and north together.

    Args:
        recording: the recording.
        white: only what is surely noise. What the accelerometer explains is taken off. The rest has to be larger than
            that, and to change its sign from row to row: fixes once a second differ more by the bends of the road than
            by an RTK's noise.
    """
    for stream, _, _, values, covariance in stated_streams(recording):
        sigmas = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))[1:-1, :2]
        fast = second_difference(values[:, :2])
        rows = np.isfinite(fast).all(axis=1)
        if rows.sum() < MIDDLE_ROWS:
            continue
        if white and stream == "position" and recording.position is not None and recording.imu is not None:
            felt = _felt(recording.imu, recording.position)
            motion = slope(fast[rows], felt[rows]) * felt
            fast = fast - motion
            if np.median(np.abs(fast[rows])) < np.median(np.abs(motion[rows])):
                continue
        fast, sigmas = fast[rows], sigmas[rows]
        usual = np.clip(fast, *(np.median(np.abs(fast)) * np.array([[-3.0], [3.0]])))
        if not white or correlation_of(usual[1:], usual[:-1]) < WHITE - 1 / np.sqrt(len(usual)):
            yield stream, _middle(fast, sigmas * np.sqrt(FAST_SHARE)), JITTER


def _felt(imu: Imu, position: Position) -> FloatArray:
    """(n - 2, 2) what forces forward and left do to x_i - (x_i-1 + x_i+1)/2 on the way from fix to fix: -a dt^2/2."""
    t_s, places = position.t_s, np.nan_to_num(position.enu_m[:, :2])
    force = window_means(imu.t_s, imu.accel_mps2[:, :2] - np.median(imu.accel_mps2[:, :2], axis=0), t_s)
    way, step_s = places[2:] - places[:-2], 0.5 * (t_s[2:] - t_s[:-2])
    ahead = way / np.maximum(np.linalg.norm(way, axis=1), 1e-9)[:, None]
    aside = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    mean = 0.5 * (force[1:] + force[:-1])
    return np.asarray(-0.5 * step_s[:, None] ** 2 * (mean[:, :1] * ahead + mean[:, 1:] * aside), dtype=np.float64)


def second_difference(x: FloatArray) -> FloatArray:
    """x_i - (x_i-1 + x_i+1)/2, in which a vehicle's motion is small and noise is not."""
    return x[1:-1] - 0.5 * (x[2:] + x[:-2])


def velocity_dependence(recording: Recording) -> Iterator[tuple[str, float]]:
    """Yield how an ENU velocity of as many rows as there are positions follows their slope; horizontal and up apart.

    The correlation is near 0 for noise of its own, and 1 where the velocity is computed from the positions. With
    s_i = (p_i - p_i-1)/(t_i - t_i-1), and x''_i = x_i - (x_i-1 + x_i+1)/2::

        max over k from -2 to 2 of corr(s''_i, v''_i-k)
    """
    position, velocity = recording.position, recording.velocity
    if position is None or velocity is None or velocity.frame != "enu" or np.isnan(position.enu_m).any():
        return
    for name, axes in (("velocity, horizontal", [0, 1]), ("velocity, up", [2])):
        _, mps = without_nan_rows(velocity.t_s, velocity.mps[:, axes])
        if len(mps) == len(position.t_s) >= MIDDLE_ROWS:
            way_mps = np.diff(position.enu_m[:, axes], axis=0) / np.diff(position.t_s)[:, None]
            inside = slice(max(SHIFTS), -max(SHIFTS))  # rolled over the ends
            shifted = [second_difference(np.roll(mps, k, axis=0)[1:])[inside] for k in SHIFTS]
            yield name, max(correlation_of(second_difference(way_mps)[inside], one) for one in shifted)
