"""Streams that do not agree on east and north, and a reference whose attitude is in degrees or of other axes."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.inspection.evidence import (
    DEG_PER_RAD,
    LEAST_WINDOWS,
    SLOWEST_MPS,
    SURE,
    WITHIN,
    Diagnosis,
    common_edges,
    correlation_of,
    diagnosis,
    mean_velocity,
    slope,
    strength,
    sure_turnings,
    wheel_speeds,
    window_means,
    without_nan_rows,
)
from jerkbench.inspection.lags import LONGEST_GAP_S, Lag, all_lags, attitude_rates, clock_offsets
from jerkbench.inspection.mounting import (
    EXCHANGED,
    IDENTITY,
    PLANE,
    axes_text,
    mended,
    mounting,
)
from jerkbench.inspection.sigmas import understated_noise
from jerkbench.io.frames import felt_axis
from jerkbench.recording import GRAVITY_MPS2, Imu, Position, Recording

LENGTHS_S = (1.0, 8.0, 32.0)
"""Slow and coarse fixes say where they went over half a minute, not over a second."""

LEAST_ROWS = 20

LEAST_FIT = 0.9
LEAST_GAIN = 0.2
"""Mended axes fit at least so well, and by so much better than the axes as they are (cosines of both series)."""

WAY_S = 5.0
"""Over shorter windows the noise of a fix is much of the way, over longer ones the bends are."""

WAY_WITHIN = 0.15
"""So far from 1 may the middle of way over way be where the axes are right: bends, slip, a wheel's scale."""

WAY_APART = 0.3
"""So far from 1 it has to be for the axes as they are."""

LARGEST_RAD = 4 * np.pi
"""Angles that are unwrapped may pass pi; roll and pitch never this."""

LARGEST_DEGREE = 4.0
"""An attitude whose yaw stays below may be in radians."""

HALF_TURN_DEG = 90.0
"""No vehicle turns so far in half a second; an angle that jumps back by 360 degrees does."""

ATTITUDE_S = 0.5
LEAST_CORRELATION = 0.5


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
    for length_s in LENGTHS_S:
        for stream, (t_s, values) in streams.items():
            if found := _exchanged(stream, *without_nan_rows(t_s, values), position, length_s):
                told.setdefault(stream, found)
    return told


def _exchanged(
    stream: str, t_s: FloatArray, values: FloatArray, position: Position, length_s: float
) -> Diagnosis | None:
    fix_s, places = without_nan_rows(position.t_s, position.enu_m[:, :2])
    if min(len(t_s), len(fix_s)) <= LEAST_ROWS:
        return None
    length_s = max(length_s, 2 * float(np.median(np.diff(fix_s))), 2 * float(np.median(np.diff(t_s))))
    edges_s = common_edges(length_s, t_s, fix_s)
    if len(edges_s) <= LEAST_ROWS:
        return None
    given_mps = (mean_velocity if stream == "reference" else window_means)(t_s, values, edges_s)
    right_mps = mean_velocity(fix_s, places, edges_s)
    size = float(np.sqrt(np.sum(given_mps**2) * np.sum(right_mps**2)))
    if size == 0:
        return None
    scores = {way: float(np.sum(mended(given_mps, way) * right_mps)) / size for way in PLANE}
    best = max(scores, key=lambda way: scores[way])
    if best == IDENTITY or scores[best] < LEAST_FIT or scores[best] - scores[IDENTITY] < LEAST_GAIN:
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
    if min(len(t_s), len(edges_s)) <= LEAST_WINDOWS:
        return []
    driven_mps = window_means(wheel[0], np.abs(wheel[1])[:, None], edges_s)
    use = driven_mps[:, 0] > SLOWEST_MPS
    if use.sum() < LEAST_WINDOWS:
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
    if steepest > LARGEST_RAD:
        yield diagnosis("attitude_in_degrees", f"roll or pitch reaches {steepest:.4g} where a half turn is 3.14")
        return
    t_s, euler = without_nan_rows(reference.t_s, reference.euler_rad)
    if imu is None or len(t_s) < LEAST_ROWS:
        return
    edges_s = common_edges(ATTITUDE_S, t_s, imu.t_s)
    if len(edges_s) > LEAST_ROWS:
        gyro = window_means(imu.t_s, imu.gyro_radps, edges_s)
        in_degrees = list(_yaw_in_degrees(t_s, euler[:, 2], edges_s, gyro[:, 2]))
        yield from in_degrees or _reversed_angles(imu, t_s, euler, edges_s, gyro)


def _yaw_in_degrees(t_s: FloatArray, yaw: FloatArray, edges_s: FloatArray, rate: FloatArray) -> Iterator[Diagnosis]:
    """Compare the changes of yaw with the gyro's z axis, but for those that are a whole turn in degrees."""
    change, turn_rad = np.diff(np.interp(edges_s, t_s, yaw)), rate * ATTITUDE_S
    plain = np.abs(change) < HALF_TURN_DEG
    if np.abs(yaw).max() < LARGEST_DEGREE or plain.sum() < LEAST_ROWS or not turn_rad[plain].any():
        return
    change, turn_rad = change[plain], turn_rad[plain]
    correlation, factor = correlation_of(change, turn_rad), abs(slope(change, turn_rad))
    sure = abs(strength(correlation, len(change))) >= SURE and abs(correlation) >= LEAST_CORRELATION
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
    if felt_axis(imu.accel_mps2) != "+z" or np.median(np.diff(t_s)) > LONGEST_GAP_S:
        return
    rates = attitude_rates(t_s, euler_rad, edges_s)
    correlations = [correlation_of(rates[:, axis], gyro[:, axis]) for axis in range(3)]
    named = zip(("roll", "pitch", "yaw"), correlations, strict=True)
    against = [name for name, r in named if r < -LEAST_CORRELATION and strength(r, len(rates)) < -SURE]
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
    units = [*accelerometer_unit(recording), *gyro_unit(recording)]
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
    return [*units, *of_imu, *of_fixes, *degrees, *exchanged.values(), *attitude, *noise]


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
