"""The doctor: mistakes in a log: axes that are mirrored or turned, streams that do not agree, units."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inspection.evidence import (
    DEG_PER_RAD,
    MIN_WINDOWS,
    SLOWEST_MPS,
    SURE,
    WITHIN,
    Diagnosis,
    Turning,
    Windows,
    common_edges,
    correlation_of,
    diagnosis,
    mean_velocity,
    over_lengths,
    slope,
    strength,
    sure_turnings,
    track_windows,
    turning_gravity,
    turning_track,
    wheel_speeds,
    wheel_windows,
    window_means,
    without_nan_rows,
)
from jerkbench.inspection.lags import MAX_GAP_S, Lag, all_lags, attitude_rates, clock_offsets
from jerkbench.inspection.noise import understated_noise
from jerkbench.io.frames import UPRIGHT, UPRIGHT_SHARE, felt_axis, gravity_share
from jerkbench.recording import GRAVITY_MPS2, Imu, Position, Recording

MIN_FIT = 0.5
MIN_GAIN = 0.4
"""Mended axes have to fit at least so well, and by so much better than the axes as they are (mean correlations)."""

VERY_SURE, SOME_GAIN = 10.0, 0.3
"""A fit that is weaker, of many noisy windows, has to be so many standard deviations from none, and so much better."""

MIN_TURN_CORRELATION = 0.4
"""A turning that goes the other way has to correlate by so much."""

TILTING = 3.0
"""Of gravity's turning, the part about x and y has to go the other way by so many standard deviations."""

LEADS_S = (-1.4, -1.2, -1.0, -0.8, -0.6, -0.4, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4)
"""By so much may a hand turn before or after its walker."""

IDENTITY = "as they are"
MIRRORED_Y = "second axis the other way"
EXCHANGED = "axes exchanged"

PLANE = {
    IDENTITY: ((1, 0), (0, 1)),
    "turned by 90 degrees": ((0, -1), (1, 0)),
    "turned by 180 degrees": ((-1, 0), (0, -1)),
    "turned by -90 degrees": ((0, 1), (-1, 0)),
    "first axis the other way": ((-1, 0), (0, 1)),
    MIRRORED_Y: ((1, 0), (0, -1)),
    EXCHANGED: ((0, 1), (1, 0)),
    "axes exchanged, both the other way": ((0, -1), (-1, 0)),
}
"""What mends each way in which two horizontal axes are exchanged, turned or mirrored: (right axes) = P (given axes)."""


class Fit(NamedTuple):
    """The way to mend the horizontal axes of the IMU that fits the track best.

    Attributes:
        way: one of `PLANE`.
        correlation: mean of forward and left, mended.
        as_given: the same of the axes as they are.
        strength: in standard deviations from none.
        basis: what it fits.
    """

    way: str
    correlation: float
    as_given: float
    strength: float
    basis: str

    @property
    def sure(self) -> bool:
        """Whether no other way could be meant."""
        return self.strength >= SURE and (self.correlation >= MIN_FIT or self.strength >= VERY_SURE)

    @property
    def wrong(self) -> bool:
        """Whether the axes as they are cannot be right."""
        least = MIN_GAIN if self.correlation >= MIN_FIT else SOME_GAIN
        return self.sure and self.way != IDENTITY and self.correlation - self.as_given >= least

    @property
    def mirrors(self) -> bool:
        """Whether the way makes left-handed axes of right-handed ones."""
        return float(np.linalg.det(np.array(PLANE[self.way]))) < 0

    def __str__(self) -> str:
        """Return it as a part of a sentence."""
        correlations = f"(correlation {self.correlation:.2f}; as they are {self.as_given:.2f})"
        return f"{self.basis}, forward and left, fits the accelerometer with its axes {self.way} {correlations}"


def mended(values: FloatArray, way: str) -> FloatArray:
    """Return values (n, 2) with the axes mended."""
    return np.asarray(values @ np.array(PLANE[way], dtype=np.float64).T, dtype=np.float64)


def axes_text(way: str, names: tuple[str, str]) -> tuple[str, str]:
    """Return which of the axes given, called ``names``, is to become the first, and which the second: "-y", "x"."""
    first, second = (("-" if sum(row) < 0 else "") + names[0 if row[0] else 1] for row in PLANE[way])
    return first, second


def mounting(recording: Recording) -> list[Diagnosis]:
    """Return what is wrong with the axes of the IMU, or with the east and north of the fixes.

    Gravity comes first: while it is not on +z, nothing else is said of axes. Then four witnesses: the track's forward
    and left acceleration against f, the same of a wheel, the track's turning against the gyro's z, and gravity's
    turning in the body against the gyro, whose sign a mirrored mounting changes and no rotation does.
    """
    if recording.imu is None:
        return []
    if felt_axis(recording.imu.accel_mps2) != "+z":
        return list(_not_upright(recording, recording.imu))
    return list(_judged(recording, recording.imu))


def _not_upright(recording: Recording, imu: Imu) -> Iterator[Diagnosis]:
    """Tell how to turn gravity to +z, where its axis is sure, or that all forces have the other sign.

    Without a track nothing says that the body is a vehicle: a sensor in a hand may lie on any side.
    """
    felt, share = gravity_share(imu.accel_mps2)
    if share <= UPRIGHT_SHARE or recording.position is None:
        return
    measured, fit = f"gravity is felt on {felt} (the cosine of the angle is {share:.2f})", plane_fit(recording)
    if felt == "-z" and fit is not None and fit.sure and fit.way == "turned by 180 degrees":
        yield diagnosis("accelerometer_reversed", f"{measured}, and {fit}")
    else:
        yield diagnosis("imu_not_upright", measured, felt=felt, axes=",".join(UPRIGHT[felt]))


def plane_fit(recording: Recording) -> Fit | None:
    """Return the best way, over the windows that say most; None without an IMU or without a track."""
    return _best_fit("the track's acceleration", over_lengths(track_windows, recording))


def _best_fit(basis: str, lengths: dict[float, Windows]) -> Fit | None:
    fits = []
    for windows in lengths.values():
        scores = {way: _score(windows, way) for way in PLANE}
        best = max(scores, key=lambda way: scores[way])
        fits.append(Fit(best, scores[best], scores[IDENTITY], strength(scores[best], len(windows)), basis))
    return max(fits, key=lambda fit: fit.strength, default=None)


def _score(windows: Windows, way: str) -> float:
    force = mended(windows.force_mps2[:, :2], way)
    return float(np.mean([correlation_of(windows.plane_mps2[:, axis], force[:, axis]) for axis in (0, 1)]))


def _judged(recording: Recording, imu: Imu) -> Iterator[Diagnosis]:
    """Weigh the witnesses: the mistake is where two of three agree on it.

    Gravity's turning has to show without the gyro's z axis, too: a slalom sways the force. Without a wheel a sensor
    that turns before it goes is in a hand: what the track says of its axes is not sure.
    """
    fit, track = plane_fit(recording), turning_track(recording)
    wheel = _best_fit("a wheel's acceleration", over_lengths(wheel_windows, recording))
    gravity, tilting = turning_gravity(imu), turning_gravity(replace(imu, gyro_radps=imu.gyro_radps * [1.0, 1.0, 0.0]))
    mirrored = _opposite(gravity) and tilting is not None and tilting.strength <= -TILTING
    if wheel is None and _leads(recording, track):
        fit = track = None
    if mirrored and (fit is None or not fit.wrong):
        yield diagnosis("imu_mirrored", _against(gravity), change="change the sign of one axis, most likely of y")
    elif _opposite(track) and not mirrored:
        yield from _against_the_gyro(_against(track), fit, wheel)
    elif fit is not None and fit.wrong:
        yield _turned(fit)
    elif (fit is None or not fit.sure) and wheel is not None and wheel.wrong:
        yield _turned(wheel)


def _opposite(turning: Turning | None) -> bool:
    return turning is not None and turning.correlation <= -MIN_TURN_CORRELATION and turning.strength <= -SURE


def _leads(recording: Recording, track: Turning | None) -> bool:
    """Whether the track turns with the gyro best some time before or after it."""
    if track is None or (windows_at := track_windows(recording, track.length_s)) is None:
        return False
    shifted = [windows for lead_s in LEADS_S if (windows := windows_at(lead_s)) is not None]
    with_gyro = [correlation_of(windows.course_change_rad, windows.turn_rad[:, 2]) for windows in shifted]
    return max(with_gyro, default=0.0) > abs(track.correlation)


def _against_the_gyro(turning: str, fit: Fit | None, wheel: Fit | None) -> Iterator[Diagnosis]:
    """Tell which of two is mirrored: the accelerometer agrees with the gyro, or with the track."""
    mirrored = fit is not None and fit.wrong and fit.way == MIRRORED_Y
    if mirrored or (wheel is not None and wheel.sure and wheel.way == IDENTITY):
        yield diagnosis("track_mirrored", f"{turning}, and {fit if mirrored else wheel}")
    elif fit is not None and fit.sure and fit.way == IDENTITY:
        yield diagnosis("gyro_reversed", f"{turning}, while {fit}")
    else:
        yield diagnosis("either_mirrored", turning)


def _turned(fit: Fit) -> Diagnosis:
    x, y = axes_text(fit.way, ("x", "y"))
    if fit.mirrors:
        change = f"x has to be {x}, and y has to be {y}, of the axes as they are read now"
        return diagnosis("imu_mirrored", str(fit), change=change)
    return diagnosis("imu_turned", str(fit), turn=fit.way.replace("turned by", "to be turned by"), x=x, y=y)


def _against(turning: Turning | None) -> str:
    return "" if turning is None else f"{turning.basis} turns against the gyro (correlation {turning.correlation:.2f})"


_LENGTHS_S = (1.0, 8.0, 32.0)
"""Slow and coarse fixes say where they went over half a minute, not over a second."""

_MIN_ROWS = 20

MIN_COSINE = 0.9
COSINE_GAIN = 0.2
"""Mended axes fit at least so well, and by so much better than the axes as they are (cosines of both series)."""

WAY_S = 5.0
"""Over shorter windows the noise of a fix is much of the way, over longer ones the bends are."""

WAY_WITHIN = 0.15
"""So far from 1 may the middle of way over way be where the axes are right: bends, slip, a wheel's scale."""

WAY_APART = 0.3
"""So far from 1 it has to be for the axes as they are."""

MAX_UNWRAPPED_RAD = 4 * np.pi
"""Angles that are unwrapped may pass pi; roll and pitch never this."""

MAX_RADIANS = 4.0
"""An attitude whose yaw stays below may be in radians."""

HALF_TURN_DEG = 90.0
"""No vehicle turns so far in half a second; an angle that jumps back by 360 degrees does."""

ATTITUDE_S = 0.5
_MIN_CORRELATION = 0.5


def exchanged_axes(recording: Recording) -> dict[str, Diagnosis]:
    """Return which of ENU velocity and reference does not have the fixes' east and north, by the stream's name.

    Both as mean velocities over 1, 8 and 32 s, the cosine of the two series is taken for each exchange of axes and
    signs; each stream once.
    """
    position, velocity, reference = recording.position, recording.velocity, recording.reference
    if position is None:
        return {}
    streams = {}
    if velocity is not None and velocity.frame == "enu":
        streams["velocity"] = velocity.t_s, velocity.mps[:, :2]
    if reference.enu_m is not None:
        streams["reference"] = reference.t_s, reference.enu_m[:, :2]
    told: dict[str, Diagnosis] = {}
    for length_s in _LENGTHS_S:
        for stream, (t_s, values) in streams.items():
            if found := _exchanged(stream, *without_nan_rows(t_s, values), position, length_s):
                told.setdefault(stream, found)
    return told


def _exchanged(
    stream: str, t_s: FloatArray, values: FloatArray, position: Position, length_s: float
) -> Diagnosis | None:
    fix_s, places = without_nan_rows(position.t_s, position.enu_m[:, :2])
    if min(len(t_s), len(fix_s)) <= _MIN_ROWS:
        return None
    length_s = max(length_s, 2 * float(np.median(np.diff(fix_s))), 2 * float(np.median(np.diff(t_s))))
    edges_s = common_edges(length_s, t_s, fix_s)
    if len(edges_s) <= _MIN_ROWS:
        return None
    given_mps = (mean_velocity if stream == "reference" else window_means)(t_s, values, edges_s)
    right_mps = mean_velocity(fix_s, places, edges_s)
    size = float(np.sqrt(np.sum(given_mps**2) * np.sum(right_mps**2)))
    if size == 0:
        return None
    scores = {way: float(np.sum(mended(given_mps, way) * right_mps)) / size for way in PLANE}
    best = max(scores, key=lambda way: scores[way])
    if best == IDENTITY or scores[best] < MIN_COSINE or scores[best] - scores[IDENTITY] < COSINE_GAIN:
        return None
    east, north = axes_text(best, ("east", "north"))
    ned = ": NED for ENU, or latitude and longitude exchanged, in one of the two" if best == EXCHANGED else ""
    fit = f"fit the fixes (cosine {scores[best]:.3f}; as they are {scores[IDENTITY]:.3f})"
    measured = f"({east}, {north}) of the {stream} {fit}"
    return diagnosis("exchanged_axes", measured, stream=stream, way=best, ned=ned)


def exchanged_degrees(recording: Recording) -> list[Diagnosis]:
    """Return whether the way of the fixes has its length only with latitude and longitude exchanged.

    Read the wrong way round, a degree of latitude counts as one of longitude: east was cos(longitude) times north, and
    north east over cos(latitude), so that the length of a way depends on its direction::

        |way|^2 = (north' cos(latitude))^2 + (east'/cos(longitude))^2
    """
    position, origin, wheel = recording.position, recording.origin, wheel_speeds(recording)
    if position is None or origin is None or wheel is None:
        return []
    t_s, places = without_nan_rows(position.t_s, position.enu_m[:, :2])
    edges_s = common_edges(WAY_S, t_s, wheel[0])
    if min(len(t_s), len(edges_s)) <= MIN_WINDOWS:
        return []
    driven_mps = window_means(wheel[0], np.abs(wheel[1])[:, None], edges_s)
    use = driven_mps[:, 0] > SLOWEST_MPS
    if use.sum() < MIN_WINDOWS:
        return []
    ways = mean_velocity(t_s, places, edges_s)[use] / driven_mps[use]
    cosines = np.abs(np.cos(np.radians([origin.latitude_deg, origin.longitude_deg])))
    scales = [[1.0, 1.0], *([1.0 / max(b, 0.01), a] for a, b in (cosines, cosines[::-1]))]
    as_given, *mended_ways = (float(np.median(np.linalg.norm(ways * scale, axis=1))) for scale in scales)
    best = min(mended_ways, key=lambda ratio: abs(ratio - 1.0))
    if abs(as_given - 1.0) < WAY_APART or abs(best - 1.0) > WAY_WITHIN:
        return []
    fixes = f"the fixes go {as_given:.2f} times as far as the wheels"
    return [diagnosis("exchanged_degrees", f"{fixes}, and {best:.2f} times with latitude and longitude exchanged")]


def attitude_mistakes(recording: Recording) -> Iterator[Diagnosis]:
    """Tell whether roll and pitch are in degrees, or turn against the gyro."""
    imu, reference = recording.imu, recording.reference
    if reference.euler_rad is None:
        return
    steepest = float(np.nan_to_num(np.abs(reference.euler_rad[:, :2])).max(initial=0.0))
    if steepest > MAX_UNWRAPPED_RAD:
        yield diagnosis("attitude_in_degrees", f"roll or pitch reaches {steepest:.4g} where a half turn is 3.14")
        return
    t_s, euler = without_nan_rows(reference.t_s, reference.euler_rad)
    if imu is None or len(t_s) < _MIN_ROWS:
        return
    edges_s = common_edges(ATTITUDE_S, t_s, imu.t_s)
    if len(edges_s) > _MIN_ROWS:
        gyro = window_means(imu.t_s, imu.gyro_radps, edges_s)
        in_degrees = list(_yaw_in_degrees(t_s, euler[:, 2], edges_s, gyro[:, 2]))
        yield from in_degrees or _reversed_angles(imu, t_s, euler, edges_s, gyro)


def _yaw_in_degrees(t_s: FloatArray, yaw: FloatArray, edges_s: FloatArray, rate: FloatArray) -> Iterator[Diagnosis]:
    """Compare the changes of yaw with the gyro's z axis, but for those that are a whole turn in degrees."""
    change, turn_rad = np.diff(np.interp(edges_s, t_s, yaw)), rate * ATTITUDE_S
    plain = np.abs(change) < HALF_TURN_DEG
    if np.abs(yaw).max() < MAX_RADIANS or plain.sum() < _MIN_ROWS or not turn_rad[plain].any():
        return
    change, turn_rad = change[plain], turn_rad[plain]
    correlation, factor = correlation_of(change, turn_rad), abs(slope(change, turn_rad))
    sure = abs(strength(correlation, len(change))) >= SURE and abs(correlation) >= _MIN_CORRELATION
    if sure and 1 / WITHIN < factor / DEG_PER_RAD < WITHIN:
        measured = f"yaw turns {factor:.3g} times as fast as the gyro says (correlation {correlation:.2f})"
        yield diagnosis("attitude_in_degrees", measured)


def _reversed_angles(
    imu: Imu, t_s: FloatArray, euler_rad: FloatArray, edges_s: FloatArray, gyro: FloatArray
) -> Iterator[Diagnosis]:
    """Compare the turning of the attitude with the gyro, axis by axis.

    FRD for FLU, or NED for ENU, turns pitch and yaw, q and r, the other way, and leaves roll. An IMU that is left in
    FRD does the same: nothing is said while gravity is not on +z.
    """
    if felt_axis(imu.accel_mps2) != "+z" or np.median(np.diff(t_s)) > MAX_GAP_S:
        return
    rates = attitude_rates(t_s, euler_rad, edges_s)
    correlations = [correlation_of(rates[:, axis], gyro[:, axis]) for axis in range(3)]
    named = zip(("roll", "pitch", "yaw"), correlations, strict=True)
    against = [name for name, r in named if r < -_MIN_CORRELATION and strength(r, len(rates)) < -SURE]
    if "pitch" in against or "yaw" in against:
        shown = ", ".join(f"{value:.2f}" for value in correlations)
        turning = f"{' and '.join(against)} turn against the gyro"
        yield diagnosis("attitude_of_frd", f"{turning} (correlations about x, y, z: {shown})")


# The doctor: mistakes that a person makes in a log, found by what its streams say of each other.

TOLERANCE = 0.25
"""So far from 1 may the median of |f|/g be after the mistake is mended: a rough ride, a scale that is off."""


def diagnoses(recording: Recording, lags: list[Lag] | None = None) -> list[Diagnosis]:
    """Return the mistakes that are sure; ``lags`` are `all_lags` of the recording, where they are known already."""
    return [*first_diagnoses(recording), *clock_offsets(all_lags(recording) if lags is None else lags)]


def first_diagnoses(recording: Recording) -> list[Diagnosis]:
    """Return them without those of the clocks, whose search takes longer.

    A mistake is told once, by those that see it best. Where streams do not agree on east and north, a reference says
    nothing of their errors. Where the IMU's units or axes are wrong, it says nothing of an attitude.
    """
    units = increments(recording) or [*accelerometer_unit(recording), *gyro_unit(recording)]
    axes, degrees, exchanged = mounting(recording), exchanged_degrees(recording), exchanged_axes(recording)
    of_fixes = [one for one in axes if one.name in ("track mirrored", "track or gyro mirrored")]
    of_imu = [one for one in axes if one not in of_fixes]
    agreed = not (of_fixes or degrees or exchanged)
    if degrees:
        of_fixes, exchanged = [], {}
    elif of_fixes and exchanged:
        measured = [of_fixes[0].measured, *(one.measured for one in exchanged.values())]
        of_fixes, exchanged = [replace(of_fixes[0], measured=", and ".join(measured))], {}
    attitude = [] if units or of_imu else list(attitude_mistakes(recording))
    noise = understated_noise(recording, reference=agreed)
    world = velocity_in_world(recording) if agreed else []
    return [*units, *of_imu, *of_fixes, *degrees, *exchanged.values(), *world, *attitude, *noise]


def increments(recording: Recording) -> list[Diagnosis]:
    """Return whether the IMU's values are sums over the time between two rows: |f| is gravity times that time."""
    imu = recording.imu
    median_mps2 = GRAVITY_MPS2 if imu is None else float(np.median(np.linalg.norm(imu.accel_mps2, axis=1)))
    if imu is None or accelerometer_unit(recording) or abs(median_mps2 / GRAVITY_MPS2 - 1.0) < TOLERANCE:
        return []
    rate_mps2 = median_mps2 / imu.nominal_interval_s
    measured = f"the median of |f| is {median_mps2:.3g}, and {rate_mps2:.3g} m/s2 divided by the step"
    found = abs(rate_mps2 / GRAVITY_MPS2 - 1.0) < TOLERANCE
    return [diagnosis("increments", measured, interval_s=imu.nominal_interval_s)] if found else []


MIN_ASIDE = 0.3
"""A body moves ahead: a velocity with a larger part across it that agrees with the track is that of the world."""


def velocity_in_world(recording: Recording) -> list[Diagnosis]:
    """Return whether a velocity in the body's axes agrees with the fixes' east and north as it is."""
    position, velocity = recording.position, recording.velocity
    if position is None or velocity is None or velocity.frame != "body":
        return []
    (fix_s, places), (t_s, mps) = (
        without_nan_rows(t_s, values[:, :2])
        for t_s, values in ((position.t_s, position.enu_m), (velocity.t_s, velocity.mps))
    )
    edges_s = common_edges(_LENGTHS_S[0], fix_s, t_s)
    if min(len(fix_s), len(t_s), len(edges_s)) <= _MIN_ROWS:
        return []
    way_mps, given_mps = mean_velocity(fix_s, places, edges_s), window_means(t_s, mps, edges_s)
    size = float(np.sqrt(np.sum(way_mps**2) * np.sum(given_mps**2)))
    cosine, aside = np.sum(way_mps * given_mps) / (size or 1.0), np.sqrt(np.mean(given_mps[:, 1] ** 2))
    if cosine < MIN_COSINE or aside < MIN_ASIDE * np.sqrt(np.mean(np.sum(given_mps**2, axis=1))):
        return []
    return [diagnosis("velocity_in_world", f"they fit east and north of the fixes (cosine {cosine:.3f})")]


def accelerometer_unit(recording: Recording) -> list[Diagnosis]:
    """Return whether the specific force is g times too small or too large; its median is gravity, moving or not."""
    if recording.imu is None:
        return []
    median_mps2 = float(np.median(np.linalg.norm(recording.imu.accel_mps2, axis=1)))
    measured = f"the median of |f| is {median_mps2:.3g} m/s2, where gravity is {GRAVITY_MPS2:g}"
    medians = {"accelerometer_in_g": 1.0, "accelerometer_too_large": GRAVITY_MPS2**2}
    return [diagnosis(m, measured) for m, median in medians.items() if abs(median_mps2 / median - 1.0) < TOLERANCE]


def gyro_unit(recording: Recording) -> list[Diagnosis]:
    """Return whether the gyro is 57.3 times too large or too small."""
    for turning in sure_turnings(recording):
        turns = f"{turning.basis} turns {abs(turning.factor):.3g} times as fast as the gyro says"
        for mistake, factor in (("gyro_in_degrees", 1 / DEG_PER_RAD), ("gyro_too_small", DEG_PER_RAD)):
            if turning.is_about(factor):
                return [diagnosis(mistake, f"{turns} (correlation {turning.correlation:.2f})")]
    return []
