"""Rest periods of the IMU, its noise at rest, and comparison of measured errors with stated sigmas."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import BoolArray, FloatArray, linear_at, streaks
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
from jerkbench.simulation.sensors import ALLAN_FLOOR, GRADES

MIN_REST_S = 5.0
_POINTS = 40
MAX_AVERAGED_FRACTION = 0.25
"""Maximum averaging time as a fraction of the rest. For a longer averaging time, there are too few averages."""

WHITE_S = (0.05, 1.0)
"""Range of averaging times for the white noise [s]. Shorter times contain resonances of the mounting, longer times
contain drift."""

FLOOR_NEEDS_S = 60.0
"""Minimum length of a rest [s] from which the minimum of the Allan deviation can be measured."""

_WINDOW_S = 0.5
"""Length of the windows in the search for a rest."""

QUIET_RADPS, QUIET_MPS2 = 0.01, 0.1
"""Maximum scatter of gyro and accelerometer (root of the sum of the axes' variances) in a window at rest."""

QUIET_FRACTION, LOUD = 0.2, 0.8
"""Alternative maximum of the scatter, for an idling engine: the fraction `QUIET_FRACTION` of the quantile `LOUD` of the
scatter of all windows. The larger of the two maxima is used."""

TURNS_RADPS = 0.03
"""Maximum angular rate at rest. The bias of a gyro is smaller."""

_MOVES_MPS = 0.3
"""Maximum speed of fixes or velocities during a rest."""


class Rest(NamedTuple):
    """A time interval in which the IMU is at rest.

    Attributes:
        begin_s: start time of the rest [s].
        end_s: end time of the rest [s].
        stated: true if the recording states the rest, false if the rest was found in the IMU samples.
    """

    begin_s: float
    end_s: float
    stated: bool

    def rows_of(self, t_s: FloatArray, values: FloatArray) -> FloatArray:
        """Return the rows of ``values`` whose times are within the rest."""
        return values[(t_s >= self.begin_s) & (t_s <= self.end_s)]


class RestNoise(NamedTuple):
    """Noise of an IMU, measured at rest.

    Attributes:
        rest: rest in which the noise was measured.
        angle_random_walk_deg_per_sqrt_h: angle random walk of the noisiest gyro axis [deg/sqrt(h)].
        velocity_random_walk_mps_per_sqrt_h: velocity random walk of the noisiest accelerometer axis [m/s/sqrt(h)].
        gyro_instability_deg_per_h: bias instability of the worst gyro axis [deg/h], which is the minimum of the Allan
            deviation divided by `ALLAN_FLOOR`; NaN if the rest is too short.
        accel_instability_mg: bias instability of the worst accelerometer axis [mg], computed as for the gyro.
        grade: grade of the simulated IMU (parameter ``dataset.imu``) with the most similar white noise.
    """

    rest: Rest
    angle_random_walk_deg_per_sqrt_h: float
    velocity_random_walk_mps_per_sqrt_h: float
    gyro_instability_deg_per_h: float
    accel_instability_mg: float
    grade: str


def stated_rest(recording: Recording) -> Rest | None:
    """Return the rest at the start that the recording states, or None if this rest is shorter than 5 s."""
    begin_s = float(recording.clock_s[0])
    long = recording.static_start_s >= MIN_REST_S
    return Rest(begin_s, begin_s + recording.static_start_s, stated=True) if long else None


def longest_rest(recording: Recording) -> Rest | None:
    """Return the stated rest, or else the longest rest in the IMU samples, or None without a rest of at least 5 s.

    The IMU may be at rest in a window of half a second if the scatter of gyro and accelerometer and the mean angular
    rate are small. A drive on a smooth road may also meet this condition, so fixes and velocities must not contradict
    the rest.
    """
    imu, stated = recording.imu, stated_rest(recording)
    edges_s = np.empty(0) if imu is None else common_edges(_WINDOW_S, imu.t_s)
    if imu is None or stated or len(edges_s) < 2:
        return stated
    rests = [  # the motion may end and start in the outer windows, which are omitted
        Rest(float(edges_s[first + (first > 0)]), float(edges_s[last - (last < len(edges_s) - 1)]), stated=False)
        for first, last in streaks(_quiet(imu, edges_s))
    ]
    long = [rest for rest in rests if rest.end_s - rest.begin_s >= MIN_REST_S and not _moves(recording, rest)]
    return max(long, key=lambda rest: rest.end_s - rest.begin_s, default=None)


def _quiet(imu: Imu, edges_s: FloatArray) -> BoolArray:
    """Return a mask of the windows between edges in which the IMU may be at rest."""
    counts = np.diff(np.searchsorted(imu.t_s, edges_s))
    mean = window_means(imu.t_s, imu.gyro_radps, edges_s)
    quiet = (counts > 0.5 * np.median(counts)) & (np.linalg.norm(mean, axis=1) < TURNS_RADPS)
    for values, least in ((imu.gyro_radps, QUIET_RADPS), (imu.accel_mps2, QUIET_MPS2)):
        centred = values - values.mean(axis=0)
        variance = window_means(imu.t_s, centred**2, edges_s) - window_means(imu.t_s, centred, edges_s) ** 2
        scatter = np.sqrt(np.maximum(variance, 0.0).sum(axis=1))
        quiet &= scatter < max(least, QUIET_FRACTION * float(np.quantile(scatter, LOUD)))
    return np.asarray(quiet)


def _moves(recording: Recording, rest: Rest) -> bool:
    """Return True if velocities or fixes indicate a motion during ``rest``."""
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
    """Return the IMU noise during ``rest`` (by default the rest stated in the recording), or None without IMU or rest.

    The white noise N is the mean of adev(tau) sqrt(tau) over averaging times tau from 0.05 to 1 s. The white noise
    includes the vibration of an idling engine.
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
    return RestNoise(rest, *walks, *floors, nearest_grade(*walks))


def allan_deviation(samples: FloatArray, interval_s: float) -> tuple[FloatArray, FloatArray]:
    """Return the averaging times (k,) and the overlapping Allan deviation (k, m) of ``samples`` (n, m).

    The Allan deviation at the averaging time tau = j dt is computed from theta, the running integral of the samples::

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
    """Return the IMU grade whose two random walks are nearest to the arguments on a logarithmic scale."""
    measured = [angle_random_walk_deg_per_sqrt_h, velocity_random_walk_mps_per_sqrt_h]
    walks = [(g.angle_random_walk_deg_per_sqrt_h, g.velocity_random_walk_mps_per_sqrt_h) for g in GRADES.values()]
    with np.errstate(divide="ignore"):
        away = np.hypot(*np.log(np.array(measured) / walks).T)
    return list(GRADES)[int(np.argmin(away))]


def _white(tau_s: FloatArray, deviation: FloatArray) -> float:
    """Return the white noise N of the noisiest axis, from the Allan ``deviation``."""
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
"""Maximum interval of the reference over which it is interpolated linearly."""

MIN_RATIO = 4.0
"""Minimum ratio of measured to stated sigma that is reported as a mistake. In urban canyons the median ratio of
receivers is up to 3.2."""

MIN_SPREAD = 2.0
"""Minimum ratio of measured to stated sigma for errors about their median. In urban canyons this ratio of receivers is
up to 1.2. Sigmas that were four times too large and are divided by ten give the ratio 2.5, which is reported."""

MAX_FIX_GAP_S = 1.1

MIDDLE_ROWS = 30
"""Minimum number of errors for a median."""

FAST_SHARE = 1.5
"""Variance of x_i - (x_i-1 + x_i+1)/2 if x is white noise with variance 1."""

WHITE = -0.3
"""Maximum correlation between consecutive values of x_i - (x_i-1 + x_i+1)/2 that indicates white noise. The theoretical
value is -2/3 for white noise, and about 0 or positive for motion. With n rows the standard deviation of the correlation
is 1/sqrt(n)."""

JITTER, AT_REST = "the jitter from row to row", "the scatter at rest"
_MEDIAN = "the median error against the reference"
SPREAD = "the scatter of the error against the reference about its median"
BY_REFERENCE = (_MEDIAN, SPREAD)
"""Error measures that need a reference."""


class Sigma(NamedTuple):
    """Stated and measured standard deviations of a stream.

    Attributes:
        stream: name of the stream, "position" or "velocity".
        unit: unit of the standard deviations, "m" or "m/s".
        basis: source of the measured errors: the scatter at rest (without slow errors) or the error against the
            reference.
        stated: (3,) root of the mean stated variance of each axis.
        real: (3,) root mean square error of each axis.
        ratio: ratio of measured to stated standard deviation: the root of the mean of e' R^-1 e per axis.
        median_ratio: robust ratio of measured to stated standard deviation, from the median of the horizontal errors.
        rows: number of rows with errors.
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
    """Return the stated and measured sigmas of position and ENU velocity, at rest and against the reference.

    A reference that is a copy of the fixes is not used. The reference is interpolated linearly between stamps with an
    interval of at most 0.5 s. Rows in which an axis was not measured are also used.

    Args:
        recording: recording with position fixes or velocities.
        rest: rest in which the scatter is measured; None for the stated rest at the start.
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
    """Return True if each axis was measured in at least `_MIN_ROWS` rows."""
    return bool((np.isfinite(values).sum(axis=0) >= _MIN_ROWS).all())


def stated_streams(recording: Recording) -> list[tuple[str, str, FloatArray, FloatArray, FloatArray]]:
    """Return the name, unit, times, values (m, 3) and covariances (m, 3, 3) of position and ENU velocity."""
    p, v = recording.position, recording.velocity
    streams = [] if p is None else [("position", "m", p.t_s, p.enu_m, p.covariance_m2)]
    if v is not None and v.frame == "enu":
        streams.append(("velocity", "m/s", v.t_s, v.mps, v.covariance_m2ps2))
    return streams


def truth_at(recording: Recording, stream: str, t_s: FloatArray, near_s: float = _NEAR_S) -> FloatArray:
    """Return the reference values (m, 3) at ``t_s``, interpolated over at most ``near_s`` [s], or NaN elsewhere."""
    reference = recording.reference
    values = reference.enu_m if stream == "position" else reference.velocity_mps
    if values is None or len(reference.t_s) < 2:
        return np.full((len(t_s), 3), np.nan)
    return linear_at(reference.t_s, values, t_s, near_s)


def _sigma(name: str, unit: str, basis: str, error: FloatArray, covariance: FloatArray) -> Sigma:
    """Return the stated and measured sigmas of ``error`` (k, 3), which is NaN for an axis that was not measured."""
    measured = np.isfinite(error)
    filled, both_measured = np.where(measured, error, 0.0), measured[:, :, None] & measured[:, None, :]
    weighed = np.linalg.solve(np.where(both_measured, covariance, np.eye(3)), filled[:, :, None])[:, :, 0]
    squares = np.einsum("ki,ki->k", filled, weighed)
    variances = np.where(measured, np.diagonal(covariance, axis1=1, axis2=2), np.nan)
    stated, real = (np.sqrt(np.nanmean(values, axis=0)) for values in (variances, error**2))
    ratio, median = float(np.sqrt(squares.sum() / measured.sum())), _middle(error[:, :2], np.sqrt(variances[:, :2]))
    return Sigma(name, unit, basis, stated, real, ratio, median, len(error))


def _middle(error: FloatArray, sigmas: FloatArray) -> float:
    """Return the robust ratio of errors to their sigmas, from the median of the squared normalised errors."""
    return float(np.sqrt(np.nanmedian((error / sigmas) ** 2) / MEDIAN_OF_SQUARE))


def understated_noise(recording: Recording, *, reference: bool = True) -> list[Diagnosis]:
    """Return a diagnosis for each stream whose measured sigma is at least four times the stated sigma.

    The ratio of measured to stated sigma is computed from the scatter at rest, from the error against a reference, and
    from the jitter between rows. For the scatter of the errors of the fixes about their median, a ratio of two is
    sufficient. Medians are used, because outliers do not indicate that all sigmas are too small.

    Args:
        recording: recording with position fixes or velocities.
        reference: if true, the reference has the same axes as the fixes and is used.
    """
    ratios = [*_jitter(recording, white=True), *(_ratio(sigma) for sigma in stated_against_real_sigma(recording))]
    least = [(entry, MIN_RATIO) for entry in ratios] + [(entry, MIN_SPREAD) for entry in _spread(recording)]
    worst: dict[str, tuple[float, str]] = {}
    for (stream, ratio, basis), limit in least:
        usable = reference or basis not in BY_REFERENCE
        if usable and ratio >= limit and ratio > worst.get(stream, (0.0, ""))[0]:
            worst[stream] = ratio, basis
    return [
        diagnosis("understated", measured, stream=stream, ratio=ratio, square=ratio**2)
        for stream, (ratio, basis) in worst.items()
        for measured in [f"{basis} is {ratio:.1f} times the stated value"]
    ]


def overstated_noise(recording: Recording, rest: Rest | None) -> Iterator[str]:
    """Yield a note for each stream whose stated sigma is at least four times the measured sigma.

    The measured sigma is computed from the error against the reference, or else from the scatter at rest, or else from
    the jitter between rows.
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
        slow = "" if against else " Slow errors are not included in this measurement, so the stated value may be right."
        yield (
            f"The standard deviations of {stream} may be too large: stated {stated:.3g} {unit}, measured"
            f" {stated * ratio:.2g} {unit}, which is {1 / ratio:.3g} times smaller ({basis}).{slow} To correct them,"
            f" multiply them by {ratio:.2g}: r_scale.{stream}={ratio**2:.2g}."
        )


def _spread(recording: Recording) -> Iterator[tuple[str, float, str]]:
    """Yield the ratio of the errors of the fixes about their median to the stated sigmas, over all axes.

    The subtraction of the median removes an offset of the reference. The reference is interpolated over intervals of up
    to 1.1 s. The interpolation error in a bend, half a metre within a second, is small compared with the sigma of a
    receiver at 1 Hz.
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
    """Yield for each stream the ratio of the jitter |x_i - (x_i-1 + x_i+1)/2| to the stated sigma, over east and north.

    Args:
        recording: recording with position fixes or velocities.
        white: if true, only streams whose jitter is certainly noise are yielded. For this test, the motion is predicted
            from the accelerometer and subtracted. The remaining jitter must be larger than the predicted motion and
            must change its sign between rows. The test is needed because bends of the road change fixes at 1 Hz by more
            than the noise of an RTK receiver.
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
        clipped = np.clip(fast, *(np.median(np.abs(fast)) * np.array([[-3.0], [3.0]])))
        if not white or correlation_of(clipped[1:], clipped[:-1]) < WHITE - 1 / np.sqrt(len(clipped)):
            yield stream, _middle(fast, sigmas * np.sqrt(FAST_SHARE)), JITTER


def _felt(imu: Imu, position: Position) -> FloatArray:
    """Return the part -a dt^2/2 (n - 2, 2) of x_i - (x_i-1 + x_i+1)/2 that forward and left forces a cause."""
    t_s, places = position.t_s, np.nan_to_num(position.enu_m[:, :2])
    force = window_means(imu.t_s, imu.accel_mps2[:, :2] - np.median(imu.accel_mps2[:, :2], axis=0), t_s)
    way, step_s = places[2:] - places[:-2], 0.5 * (t_s[2:] - t_s[:-2])
    ahead = way / np.maximum(np.linalg.norm(way, axis=1), 1e-9)[:, None]
    aside = np.column_stack([-ahead[:, 1], ahead[:, 0]])
    mean = 0.5 * (force[1:] + force[:-1])
    return np.asarray(-0.5 * step_s[:, None] ** 2 * (mean[:, :1] * ahead + mean[:, 1:] * aside), dtype=np.float64)


def second_difference(x: FloatArray) -> FloatArray:
    """Return x_i - (x_i-1 + x_i+1)/2, which suppresses the motion of a vehicle but not white noise."""
    return x[1:-1] - 0.5 * (x[2:] + x[:-2])
