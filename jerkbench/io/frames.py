"""From a sensor's axes, units and frame to ENU and the body: positions, the IMU's mounting, gravity, a standstill."""

import numpy as np

from jerkbench.arrays import FloatArray
from jerkbench.errors import PluginError, RecordingError
from jerkbench.geometry import dcm_from_euler, ecef_to_enu, ecef_to_origin, geodetic_to_ecef, geodetic_to_enu
from jerkbench.recording import GRAVITY_MPS2, Imu, Origin

FRAMES = ("enu", "ned", "geodetic", "ecef")
"""Frames of a position: local ENU or NED [m], latitude, longitude [deg or rad] and height [m], or ECEF [m]."""

LOCAL_FRAMES = ("enu", "ned")
"""Those whose zero is not said: it may be anywhere on the Earth."""

ANGLE_UNITS = {"deg": 1.0, "rad": float(np.degrees(1.0)), "1e-7 deg": 1e-7, "ddmm": 1.0}
"""Degrees in each unit of latitude and longitude; ddmm.mmmm is 100 times the degrees plus the minutes, as in NMEA."""

HEIGHT_UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "ft": 0.3048}
SPEED_UNITS = {"m/s": 1.0, "km/h": 1.0 / 3.6, "knots": 1852.0 / 3600.0, "cm/s": 0.01, "mm/s": 0.001}
"""Metres, and metres per second, in each unit."""

ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FLU_FROM_FRD = np.diag([1.0, -1.0, -1.0])
"""Each is its own inverse."""


def in_degrees(places: FloatArray, frame: str, unit: str, height_unit: str = "m") -> FloatArray:
    """Return (n, 3) places, their angles in degrees and heights in metres; those of other frames as they are."""
    if frame != "geodetic":
        return places
    angles = places[:, :2] * ANGLE_UNITS[unit]
    if unit == "ddmm":
        degrees, minutes = np.divmod(np.abs(angles), 100.0)
        angles = np.copysign(degrees + minutes / 60.0, angles)
    return np.column_stack([angles, places[:, 2] * HEIGHT_UNITS[height_unit]])


def origin_of(values: FloatArray, frame: str) -> Origin | None:
    """Return the first place as origin of ENU; None of a local frame.

    Raises:
        RecordingError: no row is complete.
    """
    if frame in LOCAL_FRAMES:
        return None
    known = np.isfinite(values).all(axis=1)
    if not known.any():
        raise RecordingError(
            "The positions have no complete row to be the origin; check their columns, or give origin."
        )
    first = values[int(np.argmax(known))]
    return ecef_to_origin(first) if frame == "ecef" else Origin(*(float(value) for value in first))


def in_enu(values: FloatArray, frame: str, origin: Origin | None) -> FloatArray:
    """Turn (n, 3) places in ``frame`` into ENU [m]; latitude and longitude in degrees.

    A latitude and longitude without a height are east and north of a place between the heights before and after.
    """
    if frame == "ned":
        return axes_in_enu(values, frame)
    if origin is None or frame == "enu":
        return values
    if frame == "ecef":
        return ecef_to_enu(values, origin)
    latitude, longitude, height_m = values.T
    enu_m = geodetic_to_enu(latitude, longitude, _between(height_m, origin.height_m), origin)
    enu_m[np.isnan(height_m), 2] = np.nan
    return enu_m


def axes_to_judge(values: FloatArray, frame: str) -> FloatArray:
    """Return (n, k) axes [m] in which places are as far from each other as they are, without an origin.

    Of latitude, longitude and height: the place on the ellipsoid in ECEF, and the height, which may be missing alone.
    """
    if frame != "geodetic":
        return values
    return np.column_stack([geodetic_to_ecef(values[:, 0], values[:, 1], np.zeros(len(values))), values[:, 2]])


def _between(height_m: FloatArray, otherwise: float) -> FloatArray:
    """The heights (n,), those that are NaN on a line between their neighbours; ``otherwise`` where there is none."""
    rows, known = np.arange(len(height_m)), ~np.isnan(height_m)
    return np.interp(rows, rows[known], height_m[known]) if known.any() else np.full(len(height_m), otherwise)


def axes_in_enu(values: FloatArray, frame: str) -> FloatArray:
    """Turn (n, 3) vectors along the axes of a local frame into ENU; an axis that is NaN stays alone."""
    return swapped(ENU_FROM_NED, values) if frame == "ned" else values


def swapped(matrix: FloatArray, vectors: FloatArray) -> FloatArray:
    """Return M v of vectors (n, 3) where M only swaps and mirrors axes; one that is NaN stays the only one."""
    axes = np.abs(matrix).argmax(axis=1)
    return np.asarray(vectors[:, axes] * matrix[np.arange(3), axes])


def covariance_in_enu(covariance: FloatArray, frame: str) -> FloatArray:
    """Turn (n, 3 k, 3 k) of k vectors along the axes of a local frame into ENU; an axis that is NaN stays alone."""
    if frame != "ned":
        return covariance
    vectors = covariance.shape[1] // 3
    places = np.add.outer(3 * np.arange(vectors), [1, 0, 2]).ravel()
    signs = np.tile([1.0, 1.0, -1.0], vectors)
    return np.asarray(covariance[:, places][:, :, places] * np.outer(signs, signs))


def turned_covariance(matrix: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return M C M' of covariances (n, 3, 3), symmetric to the bit."""
    product = np.asarray(matrix @ covariance @ matrix.T)
    return 0.5 * (product + product.transpose(0, 2, 1))


def enu_from(frame: str) -> FloatArray:
    """Return (3, 3) the turn from the axes of a local frame to ENU."""
    return ENU_FROM_NED if frame == "ned" else np.eye(3)


# The mounting of an IMU: its own axes and units -> the body's (FLU, m/s2, rad/s).

ACCEL_UNITS = {"g": 9.80665, "m/s2": 1.0}
"""Metres per second squared in each unit of specific force (g: the standard acceleration of gravity)."""

GYRO_UNITS = {"deg/s": float(np.pi / 180.0), "rad/s": 1.0}
"""Radians per second in each unit of angular rate."""


def axes_matrix(axes: tuple[str, ...]) -> FloatArray:
    """Return (3, 3) M with f_body = M f_sensor, of what the body's x, y, z are: ("z", "-y", "x") for instance.

    Raises:
        PluginError: these are not three axes of the sensor, or they make a left-handed body.
    """
    turn = np.zeros((3, 3))
    for row, axis in enumerate(axes):
        name = axis.lstrip("+-")
        if len(axes) != 3 or name not in ("x", "y", "z") or len(axis) - len(name) > 1:
            raise PluginError(f"imu_axes is {axes}; give three of x, y, z, -x, -y, -z: what the body's x, y, z are.")
        turn[row, "xyz".index(name)] = -1.0 if axis.startswith("-") else 1.0
    if not np.isclose(np.linalg.det(turn), 1.0):
        raise PluginError(f"imu_axes is {axes}, which makes no right-handed body; check the signs.")
    return turn


def body_from_sensor(signs: tuple[float, ...], yaw_deg: float, pitch_deg: float) -> FloatArray:
    """Return (3, 3) M = (Rz(yaw) Ry(pitch))' diag(signs), so that f_body = M f_sensor."""
    turned = dcm_from_euler(np.radians([0.0, pitch_deg, yaw_deg]))
    return np.asarray(turned.T @ np.diag(signs))


def imu_in_body(t_s: FloatArray, accel: FloatArray, gyro: FloatArray, units: tuple[str, str], turn: FloatArray) -> Imu:
    """Return the samples in the body's axes and units.

    Args:
        t_s: (n,) their times.
        accel: (n, 3) specific force, the sensor's axes and unit.
        gyro: (n, 3) angular rate, the sensor's axes and unit.
        units: of the specific force and of the angular rate.
        turn: (3, 3) M with f_body = M f_sensor.
    """
    accel_unit, gyro_unit = units
    return Imu(t_s, accel * ACCEL_UNITS[accel_unit] @ turn.T, gyro * GYRO_UNITS[gyro_unit] @ turn.T)


UPRIGHT_SHARE = 0.9
"""Gravity is on an axis where this part of it and more is."""

UPRIGHT = {
    "+z": ("x", "y", "z"),
    "-z": ("x", "-y", "-z"),
    "+x": ("y", "z", "x"),
    "-x": ("z", "y", "-x"),
    "+y": ("z", "x", "y"),
    "-y": ("x", "z", "-y"),
}
"""A right-handed body for each axis that gravity is felt on; which way is forward has to be measured."""


def felt_axis(accel_mps2: FloatArray) -> str:
    """Return the axis, "+z" for example, on which the median of specific forces (n, 3) is largest."""
    force = np.median(accel_mps2, axis=0)
    axis = int(np.argmax(np.abs(force)))
    return f"{'+' if force[axis] > 0 else '-'}{'xyz'[axis]}"


def gravity_share(accel_mps2: FloatArray) -> tuple[str, float]:
    """Return the axis on which gravity is felt most, and which part of it (the cosine of the angle)."""
    force = np.abs(np.median(accel_mps2, axis=0))
    return felt_axis(accel_mps2), float(force.max() / np.linalg.norm(force)) if force.any() else 0.0


def gravity_notes(accel_mps2: FloatArray, parameter: str) -> tuple[str, ...]:
    """Return a note where a body's specific forces (n, 3) have gravity on another axis than +z, else none.

    Args:
        accel_mps2: in what is taken for the body's axes.
        parameter: which parameter turns the sensor's axes into the body's.
    """
    felt = felt_axis(accel_mps2)
    note = f"The IMU feels gravity on {felt}, and a body (forward, left, up) on +z: attitude and forces are wrong until"
    return () if felt == "+z" else (f"{note} {parameter} says which of its axes point where.",)


# The standstill at the start of a recording, and the calibration of the IMU over it.

_STILL_BELOW_MPS = 0.1
"""A receiver that stands still reports less: its velocity noise is some centimetres a second."""

_MARGIN_S = 1.0
"""The time between the end of the rest and the first motion in the velocity, which is smoothed and old."""

MIN_STANDSTILL_S = 1.0
"""A mean over less says nothing about a bias."""

_SCALE_WITHIN = 0.1
"""An accelerometer that errs by more than this part of gravity is read in the wrong unit, or does not stand still."""


def first_rest_s(t_s: FloatArray, speed_mps: FloatArray, end_s: float) -> float:
    """Return when the rest that begins at time 0 ends; 0 where there is none.

    Args:
        t_s: (m,) stamps of the speed.
        speed_mps: (m,) over ground.
        end_s: when the recording ends, for one that never moves.
    """
    moving = t_s[speed_mps > _STILL_BELOW_MPS]
    return float(np.clip(moving[0] - _MARGIN_S, 0.0, end_s)) if moving.size else end_s


def calibrated_at_rest(imu: Imu, rest_s: float, *, gyro: bool, accel: bool) -> Imu:
    """Return the samples without the gyro's bias, and with the accelerometer scaled, where that is asked for.

    Raises:
        RecordingError: the rest is too short, or the accelerometer's mean over it is not near gravity.
    """
    if gyro:
        imu = without_gyro_bias(imu, rest_s)
    return scaled_to_gravity(imu, rest_s) if accel else imu


def without_gyro_bias(imu: Imu, rest_s: float) -> Imu:
    """Subtract the gyro's mean over the rest (the Earth's rate goes with it)."""
    bias = imu.gyro_radps[_at_rest(imu, rest_s)].mean(axis=0)
    return Imu(imu.t_s, imu.accel_mps2, imu.gyro_radps - bias)


def scaled_to_gravity(imu: Imu, rest_s: float) -> Imu:
    """Scale the accelerometer, all axes alike, so that its mean over the rest has the magnitude of gravity."""
    magnitude = float(np.linalg.norm(imu.accel_mps2[_at_rest(imu, rest_s)].mean(axis=0)))
    if abs(magnitude - GRAVITY_MPS2) > _SCALE_WITHIN * GRAVITY_MPS2:
        raise RecordingError(
            f"The accelerometer's mean over the first {rest_s:.1f} s is {magnitude:.3f} m/s2, not near {GRAVITY_MPS2};"
            " correct its unit or the length of the rest, or switch scale_accel_to_gravity off."
        )
    return Imu(imu.t_s, imu.accel_mps2 * (GRAVITY_MPS2 / magnitude), imu.gyro_radps)


def _at_rest(imu: Imu, rest_s: float) -> slice:
    if rest_s < MIN_STANDSTILL_S:
        raise RecordingError(
            f"The recording stands still for {rest_s:.2f} s at its start; calibrating the IMU needs"
            f" {MIN_STANDSTILL_S:.0f} s:"
            " switch remove_gyro_bias and scale_accel_to_gravity off, or give rest_s."
        )
    return slice(0, int(np.searchsorted(imu.t_s, rest_s)))
