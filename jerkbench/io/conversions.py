"""Conversion of times, axes, units and frames to UTC, ENU and body axes, and use of gravity and of the rest."""

from datetime import UTC, datetime, timedelta

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import PluginError, RecordingError
from jerkbench.geometry import dcm_from_euler, ecef_to_enu, ecef_to_origin, geodetic_to_ecef, geodetic_to_enu
from jerkbench.recording import GRAVITY_MPS2, Imu, Origin, Velocity

# GPS time, UTC, and dates as text.

GPST_MINUS_UTC_S = 18.0
"""GPS time minus UTC. Valid from 2017-01-01 until another leap second is introduced (none was announced by 2025)."""

GPS_EPOCH_NS = 315_964_800_000_000_000
"""Epoch of GPS time, 1980-01-06, in nanoseconds since 1970."""

WEEK_NS = 604_800_000_000_000

UNIX_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


def utc_of(gpst_ns: int, gpst_minus_utc_s: float = GPST_MINUS_UTC_S) -> datetime:
    """Convert a GPS time, in nanoseconds since 1970 on the GPS calendar, to UTC, rounded to microseconds.

    >>> utc_of(1_752_003_261_854_000_000).isoformat()
    '2025-07-08T19:34:03.854000+00:00'
    """
    return UNIX_EPOCH + timedelta(microseconds=round(gpst_ns / 1000)) - timedelta(seconds=gpst_minus_utc_s)


def ns_since_1970(moment: datetime) -> int:
    """Convert a UTC time to nanoseconds since 1970."""
    return (moment - UNIX_EPOCH) // timedelta(microseconds=1) * 1000


def calendar_ns(date: str, time: str) -> int | None:
    """Convert a date (``2011-09-26``) and time (``13:02:25.594``) to nanoseconds since 1970, or invalid text to None.

    >>> calendar_ns("1970-01-02", "00:00:01.5")
    86401500000000
    """
    if date[:2] not in ("19", "20", "21") or len(date) != len("2011-09-26") or set(time) - set("0123456789:."):
        return None
    try:
        return int(np.datetime64(f"{date}T{time}", "ns").astype(np.int64))
    except ValueError:  # for example the 31st of April
        return None


# Streams whose axes have a common stamp but different latencies.


def velocity_when_true(
    t_s: FloatArray, enu_mps: FloatArray, covariance_m2ps2: FloatArray, latency_s: tuple[float, ...]
) -> Velocity:
    """Assign each axis of an ENU velocity to its time of validity: the stamp minus the latency of the axis.

    Axes that were valid at the same time are in one row, with their cross-covariance. The other axes of a row are NaN.

    Args:
        t_s: (m,) stamps of the velocities [s].
        enu_mps: (m, 3) velocities in ENU [m/s].
        covariance_m2ps2: (m, 3, 3) covariances of the velocities [m2/s2].
        latency_s: latencies of the axes east, north and up [s].

    Returns:
        The velocities in the order of time, with at most 3 m rows.
    """
    valid_ns = np.round((t_s[:, None] - np.array(latency_s)) * 1e9).astype(np.int64)
    grid_ns, inverse = np.unique(valid_ns, return_inverse=True)
    rows = inverse.reshape(valid_ns.shape)
    mps, covariance = np.full((len(grid_ns), 3), np.nan), np.tile(np.eye(3), (len(grid_ns), 1, 1))
    for i in range(3):
        mps[rows[:, i], i] = enu_mps[:, i]
        for j in range(3):
            same = rows[:, i] == rows[:, j]
            covariance[rows[same, i], i, j] = covariance_m2ps2[same, i, j]
    return Velocity(grid_ns * 1e-9, mps, covariance)


# Units and frames.

FRAMES = ("enu", "ned", "geodetic", "ecef")
"""Frames of a position: local ENU or NED [m], latitude, longitude [deg or rad] and height [m], or ECEF [m]."""

LOCAL_FRAMES = ("enu", "ned")
"""Frames whose origin on the Earth is not defined."""

ANGLE_UNITS = {"deg": 1.0, "rad": float(np.degrees(1.0)), "1e-7 deg": 1e-7, "ddmm": 1.0}
"""Degrees in each unit of latitude and longitude; ddmm.mmmm is 100 times the degrees plus the minutes, as in NMEA."""

HEIGHT_UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048}
SPEED_UNITS = {"m/s": 1.0, "km/h": 1.0 / 3.6, "knots": 1852.0 / 3600.0, "cm/s": 0.01, "mm/s": 0.001}
"""Metres in each unit of height, and metres per second in each unit of speed."""

ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FLU_FROM_FRD = np.diag([1.0, -1.0, -1.0])
"""Rotations from NED to ENU and from FRD to FLU. Each matrix is its own inverse."""


def in_degrees(places: FloatArray, frame: str, unit: str, height_unit: str = "m") -> FloatArray:
    """Convert geodetic positions (n, 3) to degrees and metres. Positions in other frames are not changed."""
    if frame != "geodetic":
        return places
    angles = places[:, :2] * ANGLE_UNITS[unit]
    if unit == "ddmm":
        degrees, minutes = np.divmod(np.abs(angles), 100.0)
        angles = np.copysign(degrees + minutes / 60.0, angles)
    return np.column_stack([angles, places[:, 2] * HEIGHT_UNITS[height_unit]])


def origin_of(values: FloatArray, frame: str) -> Origin | None:
    """Return the first complete position as the origin of ENU, or None if the frame is local.

    Raises:
        RecordingError: no position has all three coordinates.
    """
    if frame in LOCAL_FRAMES:
        return None
    known = np.isfinite(values).all(axis=1)
    if not known.any():
        raise RecordingError(
            "No position has three coordinates, so the origin is unknown; check the position columns, or give origin."
        )
    first = values[int(np.argmax(known))]
    return ecef_to_origin(first) if frame == "ecef" else Origin(*(float(value) for value in first))


def in_enu(values: FloatArray, frame: str, origin: Origin | None) -> FloatArray:
    """Convert positions (n, 3) in ``frame`` to ENU [m]. Latitudes and longitudes must be in degrees.

    If a position has no height, east and north are computed with an interpolated height, and up is NaN.
    """
    if frame == "ned":
        return axes_in_enu(values, frame)
    if origin is None or frame == "enu":
        return values
    if frame == "ecef":
        return ecef_to_enu(values, origin)
    latitude, longitude, height_m = values.T
    rows, known, between_m = np.arange(len(height_m)), ~np.isnan(height_m), np.full(len(height_m), origin.height_m)
    if known.any():
        between_m = np.interp(rows, rows[known], height_m[known])
    enu_m = geodetic_to_enu(latitude, longitude, between_m, origin)
    enu_m[~known, 2] = np.nan
    return enu_m


def axes_to_judge(values: FloatArray, frame: str) -> FloatArray:
    """Return coordinates (n, k) [m] in which distances between positions can be computed without an origin.

    Geodetic positions are converted to ECEF with a height of 0, and the height, which may be NaN, becomes a fourth
    coordinate. Positions in other frames are not changed.
    """
    if frame != "geodetic":
        return values
    return np.column_stack([geodetic_to_ecef(values[:, 0], values[:, 1], np.zeros(len(values))), values[:, 2]])


def axes_in_enu(values: FloatArray, frame: str) -> FloatArray:
    """Convert vectors (n, 3) in a local frame to ENU. NaN in one axis does not affect the other axes."""
    return swapped(ENU_FROM_NED, values) if frame == "ned" else values


def swapped(matrix: FloatArray, vectors: FloatArray) -> FloatArray:
    """Return M v for vectors v (..., k) and a matrix M (k, k) that swaps and mirrors axes.

    NaN on one axis does not affect the other axes.
    """
    axes = np.abs(matrix).argmax(axis=1)
    return np.asarray(vectors[..., axes] * matrix[np.arange(len(matrix)), axes])


def covariance_in_enu(covariance: FloatArray, frame: str) -> FloatArray:
    """Convert covariances (n, 3 k, 3 k) of k vectors in a local frame to ENU. NaN does not spread to other axes."""
    if frame != "ned":
        return covariance
    matrix = np.kron(np.eye(covariance.shape[1] // 3), ENU_FROM_NED)
    return swapped(matrix, swapped(matrix, covariance).swapaxes(1, 2)).swapaxes(1, 2)


def rotated_covariance(matrix: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return M C M' for covariances C (n, 3, 3). The result is exactly symmetric."""
    product = np.asarray(matrix @ covariance @ matrix.T)
    return 0.5 * (product + product.transpose(0, 2, 1))


def enu_from(frame: str) -> FloatArray:
    """Return the rotation (3, 3) from a local frame to ENU."""
    return ENU_FROM_NED if frame == "ned" else np.eye(3)


# The mounting of an IMU: conversion from the sensor's axes and units to body axes (FLU), m/s2 and rad/s.

ACCEL_UNITS = {"g": 9.80665, "m/s2": 1.0}
"""Metres per second squared in each unit of specific force (g: the standard acceleration of gravity)."""

GYRO_UNITS = {"deg/s": float(np.pi / 180.0), "rad/s": 1.0}
"""Radians per second in each unit of angular rate."""


def axes_matrix(axes: tuple[str, ...]) -> FloatArray:
    """Return M (3, 3) with f_body = M f_sensor.

    The argument ``axes`` contains the sensor axes that point along the body's x, y and z axes, for example ("y", "-x",
    "z").

    Raises:
        PluginError: ``axes`` does not contain three axes of the sensor, or the axes are left-handed.
    """
    turn = np.zeros((3, 3))
    for row, axis in enumerate(axes):
        name = axis.lstrip("+-")
        if len(axes) != 3 or name not in ("x", "y", "z") or len(axis) - len(name) > 1:
            raise PluginError(f"imu_axes is {axes}; give three sensor axes (x, y, z, -x, -y or -z).")
        turn[row, "xyz".index(name)] = -1.0 if axis.startswith("-") else 1.0
    if not np.isclose(np.linalg.det(turn), 1.0):
        raise PluginError(f"imu_axes is {axes}, which is left-handed; check the signs.")
    return turn


def body_from_sensor(signs: tuple[float, ...], yaw_deg: float, pitch_deg: float) -> FloatArray:
    """Return M = (Rz(yaw) Ry(pitch))' diag(signs) (3, 3), so that f_body = M f_sensor."""
    return np.asarray(dcm_from_euler(np.radians([0.0, pitch_deg, yaw_deg])).T @ np.diag(signs))


UPRIGHT_SHARE = 0.9
"""Minimum cosine of the angle between gravity and the axis that is assumed to be vertical."""

UPRIGHT = {
    "+z": ("x", "y", "z"),
    "-z": ("x", "-y", "-z"),
    "+x": ("y", "z", "x"),
    "-x": ("z", "y", "-x"),
    "+y": ("z", "x", "y"),
    "-y": ("x", "z", "-y"),
}
"""Right-handed body axes for each axis that measures gravity. The forward axis is arbitrary and has to be measured."""


def felt_axis(accel_mps2: FloatArray) -> str:
    """Return the signed axis (such as "+z") on which the median of specific forces (n, 3) has the largest magnitude."""
    force = np.median(accel_mps2, axis=0)
    axis = int(np.argmax(np.abs(force)))
    return f"{'+' if force[axis] > 0 else '-'}{'xyz'[axis]}"


def gravity_share(accel_mps2: FloatArray) -> tuple[str, float]:
    """Return the axis with the smallest angle to gravity, and the cosine of this angle."""
    force = np.abs(np.median(accel_mps2, axis=0))
    return felt_axis(accel_mps2), float(force.max() / np.linalg.norm(force)) if force.any() else 0.0


def gravity_notes(accel_mps2: FloatArray, parameter: str) -> tuple[str, ...]:
    """Return a note if the largest component of gravity is not on the axis +z, otherwise an empty tuple.

    Args:
        accel_mps2: specific forces (n, 3) in the assumed body axes [m/s2].
        parameter: name of the parameter that defines the body axes; the note recommends to correct this parameter.
    """
    felt = felt_axis(accel_mps2)
    note = f"The IMU has gravity on {felt}, but a body (forward, left, up) has it on +z: attitude and forces are wrong."
    return () if felt == "+z" else (f"{note} Correct {parameter}.",)


# The standstill at the start of a recording, and the calibration of the IMU during this standstill.

_STILL_BELOW_MPS = 0.1
"""Maximum reported speed at rest. The velocity noise of a receiver is some centimetres per second."""

_MARGIN_S = 1.0
"""Margin between the end of the rest and the first motion in the velocity, because the velocity is smoothed and
delayed."""

MIN_STANDSTILL_S = 1.0
"""Minimum length of a rest from which a bias is estimated."""

_SCALE_WITHIN = 0.1
"""Maximum error of the accelerometer at rest, as a fraction of gravity. With a larger error the unit is wrong, or the
sensor is not at rest."""


def first_rest_s(t_s: FloatArray, speed_mps: FloatArray, end_s: float) -> float:
    """Return the end of the rest that starts at time 0 [s], or 0 if the vehicle moves from the start.

    Args:
        t_s: (m,) stamps of the speed [s].
        speed_mps: (m,) speed over ground [m/s].
        end_s: end of the recording [s], which is returned if the vehicle never moves.
    """
    moving = t_s[speed_mps > _STILL_BELOW_MPS]
    return float(np.clip(moving[0] - _MARGIN_S, 0.0, end_s)) if moving.size else end_s


def calibrated_at_rest(imu: Imu, rest_s: float, *, gyro: bool, accel: bool) -> Imu:
    """Remove the gyro bias if ``gyro`` is True, and scale the accelerometer if ``accel`` is True.

    The gyro bias is the mean of the gyro over the rest, and includes the rotation rate of the Earth. All axes of the
    accelerometer are scaled by one factor, so that the mean specific force over the rest has the magnitude of gravity.

    Raises:
        RecordingError: the rest is too short, or the mean specific force over the rest is not close to gravity.
    """
    rate, force = imu.gyro_radps, imu.accel_mps2
    if gyro:
        rate = rate - rate[_at_rest(imu, rest_s)].mean(axis=0)
    if accel:
        magnitude = float(np.linalg.norm(force[_at_rest(imu, rest_s)].mean(axis=0)))
        if abs(magnitude - GRAVITY_MPS2) > _SCALE_WITHIN * GRAVITY_MPS2:
            raise RecordingError(
                f"The mean specific force over the first {rest_s:.1f} s is {magnitude:.3f} m/s2 instead of"
                f" {GRAVITY_MPS2} m/s2; correct the unit or the rest length, or set scale_accel_to_gravity=false."
            )
        force = force * (GRAVITY_MPS2 / magnitude)
    return Imu(imu.t_s, force, rate)


def _at_rest(imu: Imu, rest_s: float) -> slice:
    if rest_s < MIN_STANDSTILL_S:
        raise RecordingError(
            f"The recording is stationary for {rest_s:.2f} s at its start, but the IMU calibration needs at least"
            f" {MIN_STANDSTILL_S:.0f} s. Set remove_gyro_bias=false and scale_accel_to_gravity=false, or give rest_s."
        )
    return slice(0, int(np.searchsorted(imu.t_s, rest_s)))
