"""Diagnostics of a log, which find mirrored or rotated axes, contradictory streams, and wrong units."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inspection.evidence import (
    DEG_PER_RAD,
    MAX_RATE_RATIO,
    MIN_COURSE_MPS,
    MIN_LOW_NORM,
    MIN_STRENGTH,
    MIN_WINDOWS,
    Diagnosis,
    Turning,
    Windows,
    common_edges,
    correlation_of,
    cosine,
    diagnosis,
    low_and_median_norm,
    mean_velocities,
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
from jerkbench.inspection.lags import MAX_GAP_S, Lag, all_lags, attitude_rates, bunched_stamps, clock_offsets
from jerkbench.inspection.noise import understated_noise
from jerkbench.io.conversions import UPRIGHT, UPRIGHT_SHARE, felt_axis, gravity_share
from jerkbench.recording import GRAVITY_MPS2, Imu, Position, Recording

MIN_FIT, MIN_GAIN = 0.5, 0.4
"""Minimum mean correlation with the corrected axes, and its minimum gain over the axes as given."""

MIN_WEAK_STRENGTH, MIN_WEAK_GAIN = 10.0, 0.3
"""Minimum significance, in standard deviations, and minimum gain of a fit with a lower correlation (noisy windows)."""

MIN_TURN_CORRELATION = 0.4
"""Minimum absolute value of the correlation of a turn rate with the wrong sign."""

TILTING = 3.0
"""Minimum significance, in standard deviations, of a wrong sign of the rotation of gravity about x and y."""

LEADS_S = (-1.4, -1.2, -1.0, -0.8, -0.6, -0.4, 0.4, 0.6, 0.8, 1.0, 1.2, 1.4)
"""Tested times [s] by which a sensor in a hand may turn before or after the person who carries it."""

IDENTITY = "unchanged"
MIRRORED_Y = "mirrored in the second axis"
EXCHANGED = "exchanged"

PLANE = {
    IDENTITY: ((1, 0), (0, 1)),
    "rotated by 90 degrees": ((0, -1), (1, 0)),
    "rotated by 180 degrees": ((-1, 0), (0, -1)),
    "rotated by -90 degrees": ((0, 1), (-1, 0)),
    "mirrored in the first axis": ((-1, 0), (0, 1)),
    MIRRORED_Y: ((1, 0), (0, -1)),
    EXCHANGED: ((0, 1), (1, 0)),
    "exchanged and reversed": ((0, -1), (-1, 0)),
}
"""Matrix P of each correction of two horizontal axes: (correct axes) = P (given axes)."""


class Fit(NamedTuple):
    """Correction of the horizontal axes of the IMU that agrees best with the track or the wheel.

    Attributes:
        way: name of the correction, a key of `PLANE`.
        correlation: mean correlation of the forward and left accelerations after the correction.
        as_given: mean correlation of the forward and left accelerations without a correction.
        strength: significance of ``correlation``, in standard deviations from zero.
        basis: name of the motion with which the axes are compared.
    """

    way: str
    correlation: float
    as_given: float
    strength: float
    basis: str

    @property
    def sure(self) -> bool:
        """Return True if the correlation of the corrected axes is significant."""
        return self.strength >= MIN_STRENGTH and (self.correlation >= MIN_FIT or self.strength >= MIN_WEAK_STRENGTH)

    @property
    def wrong(self) -> bool:
        """Return True if the correlation of the corrected axes is significant and clearly above ``as_given``."""
        least = MIN_GAIN if self.correlation >= MIN_FIT else MIN_WEAK_GAIN
        return self.sure and self.way != IDENTITY and self.correlation - self.as_given >= least

    @property
    def mirrors(self) -> bool:
        """Return True if the correction changes the handedness of the axes."""
        return float(np.linalg.det(np.array(PLANE[self.way]))) < 0

    def __str__(self) -> str:
        correlations = f"correlation {self.correlation:.2f}, with the axes as given {self.as_given:.2f}"
        return f"{self.basis}, forward and left, agrees with the accelerometer (axes {self.way}; {correlations})"


def mended(values: FloatArray, way: str) -> FloatArray:
    """Return the values (n, 2) with the axes corrected by ``way``, a key of `PLANE`."""
    return np.asarray(values @ np.array(PLANE[way], dtype=np.float64).T, dtype=np.float64)


def axes_text(way: str, names: tuple[str, str]) -> tuple[str, str]:
    """Return the names of the given axes that are the first and second corrected axis, for example "-y" and "x"."""
    first, second = (("-" if sum(row) < 0 else "") + names[0 if row[0] else 1] for row in PLANE[way])
    return first, second


def mounting(recording: Recording) -> list[Diagnosis]:
    """Return diagnoses of wrong axes of the IMU, or of wrong east and north axes of the fixes.

    If gravity is not on the +z axis, only this mistake is reported. If gravity is on the +z axis, four comparisons are
    made: the forward and left acceleration of the track with the specific force, the acceleration of a wheel with the
    specific force, the turn rate of the track with the z axis of the gyro, and the rotation of gravity with the gyro. A
    mirrored mounting changes the sign of the correlation of gravity and gyro, but a rotated mounting does not.
    """
    if recording.imu is None:
        return []
    if felt_axis(recording.imu.accel_mps2) != "+z":
        return list(_not_upright(recording, recording.imu))
    return list(_judged(recording, recording.imu))


def _not_upright(recording: Recording, imu: Imu) -> Iterator[Diagnosis]:
    """Yield a diagnosis if gravity is clearly not on +z: rotated axes, or specific forces with the wrong sign.

    Without a track, nothing is reported, because the IMU may be hand-held and have any orientation.
    """
    felt, share = gravity_share(imu.accel_mps2)
    if share <= UPRIGHT_SHARE or recording.position is None:
        return
    measured, fit = f"gravity is on {felt} (cosine of the angle: {share:.2f})", plane_fit(recording)
    if felt == "-z" and fit is not None and fit.sure and fit.way == "rotated by 180 degrees":
        yield diagnosis("accelerometer_reversed", f"{measured}, and {fit}")
    else:
        yield diagnosis("imu_not_upright", measured, felt=felt, axes=",".join(UPRIGHT[felt]))


def plane_fit(recording: Recording) -> Fit | None:
    """Return the best correction of the IMU axes, for the window length with the most significant correlation.

    Return None if the recording has no IMU or no usable track.
    """
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
    """Yield a diagnosis of the mistake that explains the comparisons of track, wheel and gravity with the IMU.

    The comparison of gravity with the gyro must also be significant without the z axis of the gyro, because in a
    slalom, the lateral acceleration tilts the specific force while the vehicle turns about z. If the recording has no
    wheel, and if a time shift increases the correlation of track and gyro, the IMU is assumed to be hand-held. The
    track is not used for a hand-held IMU.
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
        yield _rotated(fit)
    elif (fit is None or not fit.sure) and wheel is not None and wheel.wrong:
        yield _rotated(wheel)


def _opposite(turning: Turning | None) -> bool:
    return turning is not None and turning.correlation <= -MIN_TURN_CORRELATION and turning.strength <= -MIN_STRENGTH


def _leads(recording: Recording, track: Turning | None) -> bool:
    """Return True if a time shift increases the correlation of the track with the gyro."""
    if track is None or (windows_at := track_windows(recording, track.length_s)) is None:
        return False
    shifted = [windows for lead_s in LEADS_S if (windows := windows_at(lead_s)) is not None]
    with_gyro = [correlation_of(windows.course_change_rad, windows.turn_rad[:, 2]) for windows in shifted]
    return max(with_gyro, default=0.0) > abs(track.correlation)


def _against_the_gyro(turning: str, fit: Fit | None, wheel: Fit | None) -> Iterator[Diagnosis]:
    """Yield a diagnosis of a mirrored gyro or track, depending on which of them contradicts the accelerometer."""
    mirrored = fit is not None and fit.wrong and fit.way == MIRRORED_Y
    if mirrored or (wheel is not None and wheel.sure and wheel.way == IDENTITY):
        yield diagnosis("track_mirrored", f"{turning}, and {fit if mirrored else wheel}")
    elif fit is not None and fit.sure and fit.way == IDENTITY:
        yield diagnosis("gyro_reversed", f"{turning}, while {fit}")
    else:
        yield diagnosis("either_mirrored", turning)


def _rotated(fit: Fit) -> Diagnosis:
    x, y = axes_text(fit.way, ("x", "y"))
    if fit.mirrors:
        change = f"set x to {x} and y to {y} of the axes as read now"
        return diagnosis("imu_mirrored", str(fit), change=change)
    return diagnosis("imu_turned", str(fit), turn=fit.way, x=x, y=y)


def _against(turning: Turning | None) -> str:
    if turning is None:
        return ""
    return f"{turning.basis} turns in the opposite direction to the gyro (correlation {turning.correlation:.2f})"


_LENGTHS_S = (1.0, 8.0, 32.0)
"""Lengths of the windows [s]. With slow or coarse fixes, a direction is known over half a minute, not over a second."""

_MIN_ROWS = 20

MIN_COSINE, COSINE_GAIN = 0.9, 0.2
"""Minimum cosine between the corrected series and the fixes, and its minimum gain over the axes as given."""

WAY_S = 5.0
"""Length of the windows for comparing distances [s]. Noise dominates in short windows, bends in long windows."""

MAX_WAY_ERROR, MIN_WAY_ERROR = 0.15, 0.3
"""Limits of |q - 1|, where q is the median ratio of distances (fixes to wheels). A swap of axes is reported if |q - 1|
is at least the second limit as given, and at most the first limit after the swap."""

MAX_UNWRAPPED_RAD = 4 * np.pi
"""Maximum roll and pitch in radians. Unwrapped angles may exceed pi, but not this value."""

MAX_RADIANS = 4.0
"""An attitude whose yaw never exceeds this value may be in radians."""

HALF_TURN_DEG = 90.0
"""Maximum change of yaw in half a second. A larger change is a jump by 360 degrees."""

ATTITUDE_S = 0.5
_MIN_CORRELATION = 0.5


def exchanged_axes(recording: Recording) -> dict[str, Diagnosis]:
    """Return a diagnosis for each stream (ENU velocity, reference) whose horizontal axes contradict the fixes.

    The mean velocities of the stream and of the fixes over 1, 8 and 32 s are compared. For each swap of axes and signs,
    the cosine of the angle between the two velocities is computed. Each stream is reported at most once.
    """
    position, velocity, reference = recording.position, recording.velocity, recording.reference
    if position is None:
        return {}
    streams = {}
    if velocity is not None and velocity.frame == "enu":
        streams["velocity"] = velocity.t_s, velocity.mps[:, :2]
    if reference.enu_m is not None:
        streams["reference"] = reference.t_s, reference.enu_m[:, :2]
    mistakes: dict[str, Diagnosis] = {}
    for length_s in _LENGTHS_S:
        for stream, (t_s, values) in streams.items():
            if found := _exchanged(stream, t_s, values, position, length_s):
                mistakes.setdefault(stream, found)
    return mistakes


def _exchanged(
    stream: str, t_s: FloatArray, values: FloatArray, position: Position, length_s: float
) -> Diagnosis | None:
    steps_s = [float(np.median(np.diff(stamps_s))) for stamps_s in (t_s, position.t_s) if len(stamps_s) > 1]
    length_s = max([length_s, *(2 * step_s for step_s in steps_s)])
    right_mps, given_mps = mean_velocities(position, t_s, values, length_s, are_places=stream == "reference")
    scores = {way: cosine(mended(given_mps, way), right_mps) for way in PLANE}
    best = max(scores, key=lambda way: scores[way])
    if best == IDENTITY or scores[best] < MIN_COSINE or scores[best] - scores[IDENTITY] < COSINE_GAIN:
        return None
    east, north = axes_text(best, ("east", "north"))
    ned = ": one of them is NED instead of ENU, or has latitude and longitude swapped" if best == EXCHANGED else ""
    fit = f"agree with the fixes (cosine {scores[best]:.3f}; with the axes as given {scores[IDENTITY]:.3f})"
    measured = f"({east}, {north}) of the {stream} {fit}"
    return diagnosis("exchanged_axes", measured, stream=stream, way=best, ned=ned)


def exchanged_degrees(recording: Recording) -> list[Diagnosis]:
    """Report swapped latitude and longitude if the distances agree with the wheels only after a swap.

    If latitude and longitude are swapped, a degree of latitude is scaled as a degree of longitude. The computed east is
    cos(longitude) times the true north, and the computed north is the true east divided by cos(latitude). The length of
    a path then depends on its direction::

        |way|^2 = (north' cos(latitude))^2 + (east'/cos(longitude))^2
    """
    position, origin, wheel = recording.position, recording.origin, wheel_speeds(recording)
    if position is None or origin is None or wheel is None:
        return []
    speeds = np.repeat(np.abs(wheel[1])[:, None], 2, axis=1)
    way_mps, driven_mps = mean_velocities(position, wheel[0], speeds, WAY_S)
    use = driven_mps[:, 0] > MIN_COURSE_MPS
    if use.sum() < MIN_WINDOWS:
        return []
    ways = way_mps[use] / driven_mps[use]
    cosines = np.abs(np.cos(np.radians([origin.latitude_deg, origin.longitude_deg])))
    scales = [[1.0, 1.0], *([1.0 / max(b, 0.01), a] for a, b in (cosines, cosines[::-1]))]
    as_given, *mended_ways = (float(np.median(np.linalg.norm(ways * scale, axis=1))) for scale in scales)
    best = min(mended_ways, key=lambda ratio: abs(ratio - 1.0))
    if abs(as_given - 1.0) < MIN_WAY_ERROR or abs(best - 1.0) > MAX_WAY_ERROR:
        return []
    fixes = f"the distance between fixes is {as_given:.2f} times the distance of the wheels"
    return [diagnosis("exchanged_degrees", f"{fixes}, and {best:.2f} times after a swap")]


def attitude_mistakes(recording: Recording) -> Iterator[Diagnosis]:
    """Yield a diagnosis if the attitude is in degrees or turns in the opposite direction to the gyro."""
    imu, reference = recording.imu, recording.reference
    if reference.euler_rad is None:
        return
    max_tilt = float(np.nan_to_num(np.abs(reference.euler_rad[:, :2])).max(initial=0.0))
    if max_tilt > MAX_UNWRAPPED_RAD:
        yield diagnosis("attitude_in_degrees", f"roll or pitch reaches {max_tilt:.4g}; half a turn is 3.14 rad")
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
    """Yield a diagnosis if the comparison of the yaw changes with the z axis of the gyro shows a yaw in degrees."""
    change, turn_rad = np.diff(np.interp(edges_s, t_s, yaw)), rate * ATTITUDE_S
    plain = np.abs(change) < HALF_TURN_DEG
    if np.abs(yaw).max() < MAX_RADIANS or plain.sum() < _MIN_ROWS or not turn_rad[plain].any():
        return
    change, turn_rad = change[plain], turn_rad[plain]
    correlation, factor = correlation_of(change, turn_rad), abs(slope(change, turn_rad))
    sure = abs(strength(correlation, len(change))) >= MIN_STRENGTH and abs(correlation) >= _MIN_CORRELATION
    if sure and 1 / MAX_RATE_RATIO < factor / DEG_PER_RAD < MAX_RATE_RATIO:
        measured = f"yaw changes {factor:.3g} times as fast as the gyro measures (correlation {correlation:.2f})"
        yield diagnosis("attitude_in_degrees", measured)


def _reversed_angles(
    imu: Imu, t_s: FloatArray, euler_rad: FloatArray, edges_s: FloatArray, gyro: FloatArray
) -> Iterator[Diagnosis]:
    """Yield a diagnosis if pitch or yaw rates of the attitude have the opposite sign to the gyro.

    With FRD instead of FLU, or NED instead of ENU, pitch and yaw have the opposite sign, but roll has the same sign. An
    IMU in FRD has the same effect, so a diagnosis is reported only if gravity is on +z.
    """
    if felt_axis(imu.accel_mps2) != "+z" or np.median(np.diff(t_s)) > MAX_GAP_S:
        return
    rates = attitude_rates(t_s, euler_rad, edges_s)
    correlations = [correlation_of(rates[:, axis], gyro[:, axis]) for axis in range(3)]
    named = zip(("roll", "pitch", "yaw"), correlations, strict=True)
    against = [name for name, r in named if r < -_MIN_CORRELATION and strength(r, len(rates)) < -MIN_STRENGTH]
    if "pitch" in against or "yaw" in against:
        shown = ", ".join(f"{value:.2f}" for value in correlations)
        turning = f"{' and '.join(against)} turn in the opposite direction to the gyro"
        yield diagnosis("attitude_of_frd", f"{turning} (correlations about x, y, z: {shown})")


# Mistakes in the preparation of a log, found by comparisons of its streams.

TOLERANCE = 0.25
"""Maximum difference between 1 and the median of |f|/g after the correction (rough road or scale error)."""


def diagnoses(recording: Recording, lags: list[Lag] | None = None) -> list[Diagnosis]:
    """Return the diagnoses of all significant mistakes. If ``lags`` is None, `all_lags` computes the lags."""
    return [*first_diagnoses(recording), *clock_offsets(all_lags(recording) if lags is None else lags)]


def first_diagnoses(recording: Recording) -> list[Diagnosis]:
    """Return the diagnoses of the significant mistakes, except clock offsets, whose search takes longer.

    Each mistake is reported once, based on the best comparison. If the east and north axes of the streams contradict
    each other, errors against the reference are not used. If the units or axes of the IMU are wrong, the attitude is
    not checked.
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
    noise = [*bunched_stamps(recording), *understated_noise(recording, reference=agreed)]
    frames = [*velocity_in_world(recording), *heading_convention(recording)] if agreed else []
    return [*units, *of_imu, *of_fixes, *degrees, *exchanged.values(), *frames, *attitude, *noise]


MIN_ALIGNED, MIN_OFFSET_RAD = 0.95, 0.35
"""Minimum length of the mean of unit vectors for which their direction counts as constant, and minimum constant
difference between heading and course [rad] that is reported."""


def heading_convention(recording: Recording) -> list[Diagnosis]:
    """Report a heading that counts clockwise, or that differs from the course of the fixes by a constant angle.

    If the heading is the course plus c, the mean ``offset`` of exp(i (heading - course)) is exp(i c). If the heading is
    c minus the course, the mean ``compass`` of exp(i (heading + course)) is exp(i c).
    """
    position, heading = recording.position, recording.heading
    if position is None or heading is None:
        return []
    east_north = np.column_stack([np.cos(heading.yaw_rad), np.sin(heading.yaw_rad)])
    way, facing = (v @ [1, 1j] for v in mean_velocities(position, heading.t_s, east_north, _LENGTHS_S[0]))
    moving = np.abs(way) > MIN_COURSE_MPS
    weight = np.sum(np.abs(way) * np.abs(facing), where=moving)  # a course is less accurate if the vehicle is slow
    if moving.sum() <= _MIN_ROWS:
        return []
    offset, compass = (np.sum(facing * of_way, where=moving) / weight for of_way in (way.conj(), way))
    if abs(compass) > MIN_ALIGNED and abs(compass) > abs(offset):
        measured = f"course plus heading is {np.degrees(np.angle(compass)):.0f} deg at {moving.sum()} times"
        return [diagnosis("heading_clockwise", measured)]
    if abs(offset) < MIN_ALIGNED or abs(np.angle(offset)) < MIN_OFFSET_RAD:
        return []
    degrees = float(np.degrees(np.angle(offset)))
    zero = "; it is 0 in the north instead of the east" if abs(degrees + 90.0) < 20.0 else ""
    measured = f"it differs from the course of the fixes by {degrees:.0f} deg at {moving.sum()} times{zero}"
    return [diagnosis("heading_offset", measured, degrees=-degrees)]


def increments(recording: Recording) -> list[Diagnosis]:
    """Report IMU values that are increments: the median of |f| is gravity times the interval between two rows."""
    imu = recording.imu
    median_mps2 = GRAVITY_MPS2 if imu is None else float(np.median(np.linalg.norm(imu.accel_mps2, axis=1)))
    if imu is None or accelerometer_unit(recording) or abs(median_mps2 / GRAVITY_MPS2 - 1.0) < TOLERANCE:
        return []
    rate_mps2 = median_mps2 / imu.nominal_interval_s
    measured = f"the median of |f| is {median_mps2:.3g}; divided by the interval it is {rate_mps2:.3g} m/s2"
    found = [diagnosis("increments", measured, interval_s=imu.nominal_interval_s)]
    return found if abs(rate_mps2 / GRAVITY_MPS2 - 1.0) < TOLERANCE else []


MIN_ASIDE = 0.3
"""Minimum ratio of the lateral rms to the total rms of a velocity for the finding that the velocity is not in body
axes. In body axes, the lateral velocity is small, because a vehicle hardly moves sideways."""


def velocity_in_world(recording: Recording) -> list[Diagnosis]:
    """Report a velocity that is declared in body axes, but agrees with the east and north velocity of the fixes."""
    position, velocity = recording.position, recording.velocity
    if position is None or velocity is None or velocity.frame != "body":
        return []
    way_mps, given_mps = mean_velocities(position, velocity.t_s, velocity.mps[:, :2], _LENGTHS_S[0])
    agreement, aside = cosine(way_mps, given_mps), np.sum(given_mps[:, 1] ** 2)
    if agreement < MIN_COSINE or aside < MIN_ASIDE**2 * np.sum(given_mps**2):
        return []
    return [diagnosis("velocity_in_world", f"they agree with east and north of the fixes (cosine {agreement:.3f})")]


def accelerometer_unit(recording: Recording) -> list[Diagnosis]:
    """Report a specific force that is in g, 9.8 times too large or without gravity."""
    if (imu := recording.imu) is None:
        return []
    lowest_mps2, median_mps2 = low_and_median_norm(imu.accel_mps2)
    measured = f"the median of |f| is {median_mps2:.3g} m/s2; gravity is {GRAVITY_MPS2:g} m/s2"
    if lowest_mps2 < MIN_LOW_NORM * median_mps2 < MIN_LOW_NORM**2 * GRAVITY_MPS2:
        return [diagnosis("gravity_removed", f"{measured}; 5 % of short averages are below {lowest_mps2:.2g} m/s2")]
    medians = {"accelerometer_in_g": 1.0, "accelerometer_too_large": GRAVITY_MPS2**2}
    return [diagnosis(m, measured) for m, median in medians.items() if abs(median_mps2 / median - 1.0) < TOLERANCE]


def gyro_unit(recording: Recording) -> list[Diagnosis]:
    """Report a gyro whose angular rates are 57.3 times too large or too small."""
    for turning in sure_turnings(recording):
        turns = f"{turning.basis} turns {abs(turning.factor):.3g} times as fast as the gyro measures"
        for mistake, factor in (("gyro_in_degrees", 1 / DEG_PER_RAD), ("gyro_too_small", DEG_PER_RAD)):
            if turning.is_about(factor):
                return [diagnosis(mistake, f"{turns} (correlation {turning.correlation:.2f})")]
    return []
